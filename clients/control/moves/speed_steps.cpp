#include "clients/control/moves/speed_steps.hpp"

#include <array>

namespace drivebench::control {

Reference SpeedSteps::at(double t_s) const noexcept {
  if (t_s < 0.0) return {};
  if (t_s < p_.first_s) return {.angle_rad = p_.first_rad_s * t_s, .speed_rad_s = p_.first_rad_s};
  return {.angle_rad = p_.first_rad_s * p_.first_s + p_.second_rad_s * (t_s - p_.first_s),
          .speed_rad_s = p_.second_rad_s};
}

std::span<const GainRow<SpeedStepsParameters>> SpeedStepsParameters::gains() noexcept {
  using P = SpeedStepsParameters;
  static constexpr auto kRows = std::to_array<GainRow<P>>({
      {"steps.first_rad_s", [](P& p) -> double& { return p.first_rad_s; }},
      {"steps.first_s", [](P& p) -> double& { return p.first_s; }, GainRule::kDuration},
      {"steps.second_rad_s", [](P& p) -> double& { return p.second_rad_s; }},
      {"steps.second_s", [](P& p) -> double& { return p.second_s; }, GainRule::kDuration},
  });
  return kRows;
}

std::vector<std::string> SpeedStepsParameters::problems() const {
  return range_problems(*this);
}

}  // namespace drivebench::control
