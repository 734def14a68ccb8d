#pragma once

#include "clients/identification/data/settings.hpp"

namespace drivebench::identification {

/// L, R, K_T, J, f of a permanent-magnet DC motor by least squares on
///   L i' + R i + K_T w = v
///   J w' + f w - K_T i = 0
/// with current, voltage and angle through the same filter. Source: the book, 2.7; tags IDN-01..03.
Result identify_dc_motor(const MeasuredData& data, const Settings& settings);

}  // namespace drivebench::identification
