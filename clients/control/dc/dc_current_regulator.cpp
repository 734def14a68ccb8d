#include "clients/control/dc/dc_current_regulator.hpp"

#include <algorithm>

namespace drivebench::control {

double DcCurrentRegulator::step(double wanted_a, double measured_a) noexcept {
  const double command_a = std::clamp(wanted_a, -current_limit_a_, current_limit_a_);
  const double error_a = command_a - measured_a;
  const double wanted_v = gains_.proportional_v_per_a * error_a + integral_v_;
  const double given_v = std::clamp(wanted_v, -voltage_limit_v_, voltage_limit_v_);
  const bool outward = (wanted_v - given_v) * error_a > 0.0;
  if (!outward) integral_v_ += gains_.integral_v_per_as * period_s_ * error_a;
  saturated_ = given_v != wanted_v || command_a != wanted_a;
  return given_v;
}

}  // namespace drivebench::control
