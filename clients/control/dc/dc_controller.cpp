#include "clients/control/dc/dc_controller.hpp"

#include <algorithm>

namespace drivebench::control {

std::vector<std::string> DcAxisParameters::problems() const {
  std::vector<std::string> found = shaft.problems(machine.friction_rate_per_s(), period_s());
  if (drive == DcDrive::kOwnRegulator) {
    // The held voltage moves the current by K_P·T/L of the error in a period.
    if (!(current.proportional_v_per_a * period_s() < 2.0 * machine.inductance_h)) {
      found.emplace_back(
          "current.proportional_v_per_a must be below 2 L times the sample rate: the sampled current loop is "
          "unstable");
    }
    if (current.proportional_v_per_a == 0.0)
      found.emplace_back("current.proportional_v_per_a must be positive");
  }
  return found;
}

DcController::DcController(const DcAxisParameters& axis, Law law) noexcept
    : Controller(
          law == Law::kCurrent && axis.drive == DcDrive::kCurrentAmplifier ? Quantity::kCurrent
                                                                           : Quantity::kVoltage,
          {law == Law::kCurrent ? "i_ref_a" : "v_ref_v", "angle_error_rad", "speed_rad_s", "load_rad_s2"}),
      acceleration_per_a_(axis.machine.acceleration_per_a()),
      period_s_(axis.period_s()),
      law_(law),
      drive_(axis.drive),
      current_limit_a_(axis.current_limit_a),
      voltage_limit_v_(axis.voltage_limit_v),
      regulator_(axis.current, axis.current_limit_a, axis.voltage_limit_v, axis.period_s()),
      shaft_(axis.shaft, axis.machine.friction_rate_per_s(), axis.period_s()) {}

Setpoint DcController::step(const Measurement& m, const Reference& r, std::int64_t periods) noexcept {
  const ShaftEstimate& shaft = shaft_.update(m, acceleration_per_a_ * m.i_a_a, periods);
  const double asked = wanted(r, shaft, m.i_a_a);
  const double limit = law_ == Law::kCurrent ? current_limit_a_ : voltage_limit_v_;
  const double allowed = std::clamp(asked, -limit, limit);
  double excess = asked - allowed;
  double given = allowed;
  bool saturated = excess != 0.0;
  if (law_ == Law::kCurrent && drive_ == DcDrive::kOwnRegulator) {
    given = regulator_.step(allowed, m.i_a_a);
    // A voltage at its limit holds the current back: the law must not go on towards where it pushes.
    if (regulator_.saturated()) {
      saturated = true;
      if (excess == 0.0) excess = given;
    }
  }
  integrate(excess);
  tell({.angle_rad = shaft.angle_rad, .speed_rad_s = shaft.speed_rad_s, .saturated = saturated},
       {asked, r.angle_rad - shaft.angle_rad, shaft.speed_rad_s, shaft.load_rad_s2});
  return {.a = given};
}

}  // namespace drivebench::control
