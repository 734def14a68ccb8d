#include "clients/control/estimators/load_observers.hpp"
#include "plant/math/unbounded.hpp"

namespace drivebench::control {

LoadTorqueObserver::LoadTorqueObserver(const InductionMachineModel& machine, const LoadObserverGains& gains,
                                       double period_s) noexcept
    : gains_(gains),
      friction_rate_per_s_(machine.friction_rate_per_s()),
      inertia_kgm2_(machine.inertia_kgm2),
      period_s_(period_s) {}

void LoadTorqueObserver::step(double measured_angle_rad, double motor_acceleration_rad_s2) noexcept {
  const double error_rad = measured_angle_rad - angle_rad_;
  angle_rad_ += period_s_ * (speed_rad_s_ + gains_.angle_per_s * error_rad);
  speed_rad_s_ += period_s_ * (motor_acceleration_rad_s2 - friction_rate_per_s_ * speed_rad_s_ -
                               load_rad_s2_ + gains_.speed_per_s2 * error_rad);
  load_rad_s2_ += period_s_ * gains_.load_per_s3 * error_rad;
}

CoupledObserver::CoupledObserver(const InductionMachineModel& machine, const SpeedObserverGains& gains,
                                 double period_s) noexcept
    : acceleration_per_wb_a_(machine.acceleration_per_wb_a()),
      flux_(machine, period_s),
      speed_(gains, machine.friction_rate_per_s(), period_s) {}

void CoupledObserver::step(TwoPhase current_a, double shaft_angle_rad) noexcept {
  step(to_dq(current_a, cos_sin_unbounded(flux_.angle_rad())), shaft_angle_rad);
}

void CoupledObserver::step(Dq current_a, double shaft_angle_rad) noexcept {
  const double motor_rad_s2 = acceleration_per_wb_a_ * flux_.magnitude_wb() * current_a.q;
  flux_.step(current_a, speed_.speed_rad_s());
  speed_.step(shaft_angle_rad, motor_rad_s2);
}

}  // namespace drivebench::control
