#pragma once

#include "clients/control/estimators/observers.hpp"

// Observers of the speed of an induction machine with what else must be known for it: the load torque, the
// flux.
namespace drivebench::control {

/// Gains of the load-torque observer. Poles −r1, −r2, −r3 need l1 = Σr − f/J, l2 = Σr_i·r_j − l1·f/J and
/// l3 = −r1·r2·r3, negative: s³ + (l1 + f/J)·s² + (l2 + l1·f/J)·s − l3.
struct LoadObserverGains {
  double angle_per_s;   ///< l1
  double speed_per_s2;  ///< l2
  double load_per_s3;   ///< l3

  static constexpr LoadObserverGains placed(double r1_per_s, double r2_per_s, double r3_per_s,
                                            double friction_rate_per_s) noexcept {
    const double l1 = r1_per_s + r2_per_s + r3_per_s - friction_rate_per_s;
    return {.angle_per_s = l1,
            .speed_per_s2 =
                r1_per_s * r2_per_s + r1_per_s * r3_per_s + r2_per_s * r3_per_s - l1 * friction_rate_per_s,
            .load_per_s3 = -r1_per_s * r2_per_s * r3_per_s};
  }
};

/// Angle, speed and load from the encoder and the torque the machine should be making:
///   dθ̂/dt = ω̂ + l1·e        dω̂/dt = α_motor − (f/J)·ω̂ − t̂ + l2·e        dt̂/dt = l3·e
/// with e = θ − θ̂ and t = τ_L/J. Forward Euler. Source: the book, exercise 25 and the slides of chapter
/// 8 (IMO-09), which print r1·r2 twice in l2 and leave t̂ out of the speed.
class LoadTorqueObserver {
 public:
  LoadTorqueObserver(const InductionMachineModel& machine, const LoadObserverGains& gains,
                     double period_s) noexcept;

  double angle_rad() const noexcept { return angle_rad_; }
  double speed_rad_s() const noexcept { return speed_rad_s_; }
  double load_nm() const noexcept { return inertia_kgm2_ * load_rad_s2_; }
  void step(double measured_angle_rad, double motor_acceleration_rad_s2) noexcept;

 private:
  LoadObserverGains gains_;
  double friction_rate_per_s_;
  double inertia_kgm2_;
  double period_s_;
  double angle_rad_ = 0.0;
  double speed_rad_s_ = 0.0;
  double load_rad_s2_ = 0.0;  // τ_L/J
};

/// The four states of field-oriented control, each estimated with the others:
///   dρ̂/dt = n_p·ω̂ + η·M·i_q/ψ̂        dψ̂/dt = −η·ψ̂ + η·M·i_d
///   dθ̂/dt = ω̂ + l1·e        dω̂/dt = μ·ψ̂·i_q − (f/J)·ω̂ + l2·e
/// with i_d, i_q taken along ρ̂. Forward Euler. Source: 8.3.3 (IMO-05).
class CoupledObserver {
 public:
  CoupledObserver(const InductionMachineModel& machine, const SpeedObserverGains& gains,
                  double period_s) noexcept;

  double flux_magnitude_wb() const noexcept { return flux_.magnitude_wb(); }
  double flux_angle_rad() const noexcept { return flux_.angle_rad(); }
  double angle_rad() const noexcept { return speed_.angle_rad(); }
  double speed_rad_s() const noexcept { return speed_.speed_rad_s(); }
  void step(TwoPhase current_a, double shaft_angle_rad) noexcept;
  /// With currents already along ρ̂.
  void step(Dq current_a, double shaft_angle_rad) noexcept;

 private:
  double acceleration_per_wb_a_;  // μ
  PolarFluxObserver flux_;
  SpeedObserver speed_;
};

}  // namespace drivebench::control
