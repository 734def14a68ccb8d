#pragma once

#include <vector>

#include "clients/identification/data/result.hpp"
#include "clients/identification/data/settings.hpp"
#include "clients/identification/refinement/predictor.hpp"
#include "clients/identification/refinement/unknowns.hpp"

namespace drivebench::identification {

/// Adds the errors of the sensors that the settings look for to the parameters of a result, as none, and to
/// the unknowns. A coordinate of an offset is a hundredth of the largest signal.
void add_sensors(const Settings& settings, const PredictorRecord& record, Result& result,
                 std::vector<Unknown>& unknowns);

/// The errors in the parameters of a result.
SensorErrors errors_of(const Result& result);

/// Moves them from the parameters to Result::sensors, and says what the data cannot tell. An error that
/// nothing explains, or whose interval is wider than a tenth, of a gain or of the largest signal, loses its
/// number.
void set_apart(const Settings& settings, const std::vector<Unknown>& unknowns, bool explained,
               Result& result);

}  // namespace drivebench::identification
