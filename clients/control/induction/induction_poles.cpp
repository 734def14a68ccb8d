#include "clients/control/induction/induction_poles.hpp"

#include <array>

#include "clients/control/math/polynomial.hpp"

namespace drivebench::control {

std::vector<std::complex<double>> mechanical_poles(const ServoGains& gains) {
  return roots(std::array{gains.integral_per_s3, gains.proportional_per_s2, gains.derivative_per_s, 1.0});
}

std::vector<std::complex<double>> flux_poles(const InductionMachineModel& machine, const FluxGains& gains) {
  const double eta = machine.flux_decay_per_s();
  const double gain = eta * machine.mutual_inductance_h;
  return roots(std::array{gain * gains.integral_a_per_wbs, eta + gain * gains.proportional_a_per_wb, 1.0});
}

std::vector<std::complex<double>> current_poles(const InductionMotorModel& motor, const CurrentGains& gains) {
  const double inductance_h = motor.leakage_inductance_h();
  return roots(std::array{gains.integral_v_per_as / inductance_h,
                          motor.current_decay_per_s() + gains.proportional_v_per_a / inductance_h, 1.0});
}

}  // namespace drivebench::control
