#pragma once

#include <string>
#include <vector>

#include "clients/identification/data/result.hpp"
#include "clients/identification/math/series.hpp"

namespace drivebench::identification {

/// The torque that accelerates, rms, over spans of a hundredth of the window [N m].
double accelerating_torque(const Series& speeds, double period_s, double inertia);

/// The parameters that these data do not determine. The electrical ones share the voltages: where one is
/// open, the valley of the error bends, and none of them is stated. `torque_nm` accelerates, `speed_rad_s` is
/// an rms.
std::vector<std::string> unseen_parameters(const Result& result, double torque_nm, double speed_rad_s);

/// Of a motor with a magnetising curve: the split of the leakages and both of them, if an interval is wider
/// than a tenth. Nothing else hangs on them, and the motor file has the likeliest split.
std::vector<std::string> unseen_split(const Result& result);

}  // namespace drivebench::identification
