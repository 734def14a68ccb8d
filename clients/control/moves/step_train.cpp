#include "clients/control/moves/step_train.hpp"

#include <algorithm>
#include <cmath>

namespace drivebench::control {

Reference StepTrainParameters::at(double t_s) const noexcept {
  if (t_s < 0.0) return {};
  // A billionth of a step is what rounding does to a sample time.
  const double taken = std::floor(t_s * rate_hz + 1e-9) + 1.0;
  return {.angle_rad = step_rad * std::min(taken, steps)};
}

std::vector<std::string> StepTrainParameters::problems() const {
  std::vector<std::string> found = range_problems(*this);
  if (found.empty() && steps != std::floor(steps)) found.emplace_back("train.steps must be a whole number");
  return found;
}

}  // namespace drivebench::control
