#include "clients/control/moves/step_train.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace drivebench::control {

Reference StepTrain::at(double t_s) const noexcept {
  if (t_s < 0.0) return {};
  // A billionth of a step is what rounding does to a sample time.
  const double taken = std::floor(t_s * p_.rate_hz + 1e-9) + 1.0;
  return {.angle_rad = p_.step_rad * std::min(taken, p_.steps)};
}

std::span<const GainRow<StepTrainParameters>> StepTrainParameters::gains() noexcept {
  using P = StepTrainParameters;
  static constexpr auto kRows = std::to_array<GainRow<P>>({
      {"train.step_rad", [](P& p) -> double& { return p.step_rad; }},
      {"train.steps", [](P& p) -> double& { return p.steps; }, GainRule::kPositive},
      {"train.rate_hz", [](P& p) -> double& { return p.rate_hz; }, GainRule::kPositive},
  });
  return kRows;
}

std::vector<std::string> StepTrainParameters::problems() const {
  std::vector<std::string> found = range_problems(*this);
  if (found.empty() && steps != std::floor(steps)) found.emplace_back("train.steps must be a whole number");
  return found;
}

}  // namespace drivebench::control
