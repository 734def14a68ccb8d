#pragma once

#include "clients/identification/data/settings.hpp"

namespace drivebench::identification {

/// One call: data and kind give parameters, error indices and a verdict. Columns: i_a_a, i_b_a, i_c_a and
/// u_a_v, u_b_v, u_c_v (the third ones of three-phase machines only; a DC motor has phase a), encoder_count
/// or angle_rad. Throws IdentificationError if the data cannot be used at all; if they can but do not excite
/// the motor, the result says so.
Result identify(const MeasuredData& data, const Settings& settings);

}  // namespace drivebench::identification
