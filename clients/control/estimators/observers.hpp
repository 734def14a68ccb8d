#pragma once

#include <cstdint>
#include <tuple>

#include "clients/control/gains/gains.hpp"
#include "clients/models/induction_machine.hpp"
#include "plant/math/frames.hpp"

namespace drivebench::control {

/// Rotor flux in polar form, an open-loop copy of the machine's flux equations:
///   dψ/dt = −η·ψ + η·M·i_d        dρ/dt = n_p·ω + η·M·i_q/ψ
/// Stepped by forward Euler with the currents of the sample. ψ starts at 1e-4 Wb and the division takes at
/// least 1e-3 Wb, since an unmagnetised machine has no flux direction; ρ starts at 0, which becomes true
/// because i_d builds the flux there. Source: the book, (8.37) (IMO-02).
class PolarFluxObserver {
 public:
  PolarFluxObserver(const InductionMachineModel& machine, double period_s) noexcept;

  double magnitude_wb() const noexcept { return magnitude_wb_; }
  double angle_rad() const noexcept { return angle_rad_; }  ///< in (−π, π]

  void start_at(double magnitude_wb) noexcept { magnitude_wb_ = magnitude_wb; }
  /// From this sample to the next one.
  void step(Dq current_a, double speed_rad_s) noexcept;

 private:
  double decay_;           // η·T
  double gain_;            // η·M·T
  double pole_pairs_t_s_;  // n_p·T
  double magnitude_wb_ = 1e-4;
  double angle_rad_ = 0.0;
};

/// The polar observer with the angle counted from the rotor: ρ = n_p·θ + s, which needs no speed:
///   dψ/dt = −η·ψ + η·M·i_d        ds/dt = η·M·i_q/ψ
/// Forward Euler; start and divisor as in PolarFluxObserver. Source: exercise 23 (IMO-08).
class PositionFluxObserver {
 public:
  PositionFluxObserver(const InductionMachineModel& machine, double period_s) noexcept;

  double magnitude_wb() const noexcept { return magnitude_wb_; }
  /// Of the flux from phase a, not wrapped, with the measured shaft angle of the same sample.
  double angle_rad(double shaft_angle_rad) const noexcept {
    return pole_pairs_ * shaft_angle_rad + slip_angle_rad_;
  }
  void step(Dq current_a) noexcept;

 private:
  double decay_;  // η·T
  double gain_;   // η·M·T
  double pole_pairs_;
  double magnitude_wb_ = 1e-4;
  double slip_angle_rad_ = 0.0;
};

/// Gains of the speed observer. Poles −r1, −r2 need l1 = r1 + r2 − f/J and l2 = r1·r2 − l1·f/J.
struct SpeedObserverGains {
  double angle_per_s;   ///< l1
  double speed_per_s2;  ///< l2

  static constexpr SpeedObserverGains placed(double r1_per_s, double r2_per_s,
                                             double friction_rate_per_s) noexcept {
    const double l1 = r1_per_s + r2_per_s - friction_rate_per_s;
    return {.angle_per_s = l1, .speed_per_s2 = r1_per_s * r2_per_s - l1 * friction_rate_per_s};
  }

  static constexpr std::tuple kGains{
      gain("angle_per_s", &SpeedObserverGains::angle_per_s, GainRule::kNotNegative),
      gain("speed_per_s2", &SpeedObserverGains::speed_per_s2, GainRule::kNotNegative)};
};

/// Angle and speed from the encoder and the torque the machine should be making:
///   dθ̂/dt = ω̂ + l1·(θ − θ̂)        dω̂/dt = α_motor − (f/J)·ω̂ + l2·(θ − θ̂)
/// Forward Euler: at 8 kHz the book's gains put the poles at 0.876 and 0.899. Source: the book, (8.40)
/// (IMO-04).
class SpeedObserver {
 public:
  SpeedObserver(const SpeedObserverGains& gains, double friction_rate_per_s, double period_s) noexcept
      : gains_(gains), friction_rate_per_s_(friction_rate_per_s), period_s_(period_s) {}

  double speed_rad_s() const noexcept { return speed_rad_s_; }
  double angle_rad() const noexcept { return angle_rad_; }

  /// From this sample to the next one.
  void step(double measured_angle_rad, double motor_acceleration_rad_s2) noexcept;

 private:
  SpeedObserverGains gains_;
  double friction_rate_per_s_;
  double period_s_;
  double angle_rad_ = 0.0;
  double speed_rad_s_ = 0.0;
};

/// The speed that a controller works with.
enum class SpeedSource {
  kObserver,
  kBackwardDifference,  ///< shows what encoder noise does; not for use
};

/// Speed as the last change of the count over the time it took. Its error against the mean speed stays below
/// one count per period, 25.13 rad/s at 2000 counts and 8 kHz, which is why it is not used to control.
/// Source: the book, (8.38) (IMO-03).
class BackwardDifference {
 public:
  BackwardDifference(double counts_per_revolution, double period_s) noexcept;

  /// The speed at this sample; the first one has nothing before it and gives 0.
  double step(std::int64_t count, std::int64_t periods) noexcept;

 private:
  double rad_s_per_count_;
  std::int64_t last_count_ = 0;
  bool started_ = false;
};

}  // namespace drivebench::control
