#include "clients/control/estimators/observers.hpp"

#include <algorithm>

#include "clients/control/math/wrapped.hpp"

namespace drivebench::control {

PolarFluxObserver::PolarFluxObserver(const InductionMachineModel& machine, double period_s) noexcept
    : decay_(machine.flux_decay_per_s() * period_s),
      gain_(machine.flux_decay_per_s() * machine.mutual_inductance_h * period_s),
      pole_pairs_t_s_(machine.pole_pairs * period_s) {}

void PolarFluxObserver::step(Dq current_a, double speed_rad_s) noexcept {
  constexpr double kLeastDivisorWb = 1e-3;
  angle_rad_ = wrapped(angle_rad_ + pole_pairs_t_s_ * speed_rad_s +
                       gain_ * current_a.q / std::max(magnitude_wb_, kLeastDivisorWb));
  magnitude_wb_ += gain_ * current_a.d - decay_ * magnitude_wb_;
}

PositionFluxObserver::PositionFluxObserver(const InductionMachineModel& machine, double period_s) noexcept
    : decay_(machine.flux_decay_per_s() * period_s),
      gain_(machine.flux_decay_per_s() * machine.mutual_inductance_h * period_s),
      pole_pairs_(machine.pole_pairs) {}

void PositionFluxObserver::step(Dq current_a) noexcept {
  constexpr double kLeastDivisorWb = 1e-3;
  slip_angle_rad_ += gain_ * current_a.q / std::max(magnitude_wb_, kLeastDivisorWb);
  magnitude_wb_ += gain_ * current_a.d - decay_ * magnitude_wb_;
}

void SpeedObserver::step(double measured_angle_rad, double motor_acceleration_rad_s2) noexcept {
  const double error_rad = measured_angle_rad - angle_rad_;
  angle_rad_ += period_s_ * (speed_rad_s_ + gains_.angle_per_s * error_rad);
  speed_rad_s_ += period_s_ * (motor_acceleration_rad_s2 - friction_rate_per_s_ * speed_rad_s_ +
                               gains_.speed_per_s2 * error_rad);
}

BackwardDifference::BackwardDifference(double counts_per_revolution, double period_s) noexcept
    : rad_s_per_count_(2.0 * std::numbers::pi / counts_per_revolution / period_s) {}

double BackwardDifference::step(std::int64_t count, std::int64_t periods) noexcept {
  const std::int64_t moved = started_ ? count - last_count_ : 0;
  last_count_ = count;
  started_ = true;
  return rad_s_per_count_ * static_cast<double>(moved) /
         static_cast<double>(std::max<std::int64_t>(periods, 1));
}

}  // namespace drivebench::control
