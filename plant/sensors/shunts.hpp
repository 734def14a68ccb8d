#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <numbers>

#include "plant/windings.hpp"

namespace drivebench {

/// The place of the resistors by which currents are measured.
enum class ShuntPlace : std::int64_t {
  kInline,   ///< in the wires of the motor
  kLowSide,  ///< between the lower switch and diode of each leg and the negative rail: 0 while the leg is
             ///< high
  kLink,     ///< one in the link: the sum of the currents of the legs that are at the upper rail
};

/// Where and when the currents are converted; part of section [axis.current_sensor]. Instants count from the
/// start of the tick that leads to the sample.
struct ShuntParameters {
  ShuntPlace place = ShuntPlace::kInline;
  double sample_s = 0.0;  ///< of the first conversion; 0: the end of the tick
  /// The same as an angle of the last PWM period of the tick: a centred period has its valley at 0 and 2 pi,
  /// its peak at pi. 0: sample_s gives the instant.
  double sample_angle_rad = 0.0;
  double conversion_s = 0.0;  ///< from one conversion to the next: a, b, c, or twice the link; 0: all at once

  /// Whether the currents are other ones than those in the wires at the end of the tick.
  bool used() const noexcept { return place != ShuntPlace::kInline || has_instant(); }
  bool has_instant() const noexcept { return sample_s > 0.0 || sample_angle_rad > 0.0; }
  /// Of conversion n in a tick of period_s, of which so many periods of the PWM are.
  double instant_s(std::size_t n, double period_s, int pwm_periods) const noexcept {
    if (!has_instant()) return period_s;
    const double pwm_s = period_s / pwm_periods;
    const double before_end_s = pwm_s * (1.0 - sample_angle_rad / (2.0 * std::numbers::pi));
    const double first_s = sample_angle_rad > 0.0 ? period_s - before_end_s : sample_s;
    return first_s + static_cast<double>(n) * conversion_s;
  }
};

/// What the converters hold. 8-byte members only.
struct ShuntMemory {
  std::array<double, 3> held_a{};
};

/// The shunts of an axis. An instant of conversion ends a piece of the tick, so that a conversion takes the
/// exact current; an edge at that instant comes after it.
class Shunts {
 public:
  Shunts(const ShuntParameters& p, double period_s, int pwm_periods) noexcept : p_(p), period_s_(period_s) {
    for (std::size_t n = 0; n < instant_s_.size(); ++n)
      instant_s_[n] = p.instant_s(n, period_s, pwm_periods);
  }
  bool used() const noexcept { return p_.used(); }

  /// The next instant of conversion after start_s, or end_s.
  double stop_s(double start_s, double end_s) const noexcept {
    double next_s = end_s;
    for (std::size_t n = 0; n < 3; ++n) {
      if (instant_s_[n] > start_s + tolerance_s() && instant_s_[n] < next_s - tolerance_s())
        next_s = instant_s_[n];
    }
    return next_s;
  }

  /// A piece has ended at now_s. `terminal_v` are its voltages against the middle of the link.
  void follow(ShuntMemory& m, double now_s, const PhaseValues& current_a,
              const PhaseValues& terminal_v) const noexcept {
    for (std::size_t n = 0; n < 3; ++n) {
      const double late_s = now_s - instant_s_[n];
      if (late_s > tolerance_s() || late_s < -tolerance_s()) continue;
      m.held_a[n] =
          p_.place == ShuntPlace::kLink ? link_a(n, current_a, terminal_v) : leg_a(n, current_a, terminal_v);
    }
  }

 private:
  static constexpr double of(const PhaseValues& x, std::size_t n) noexcept {
    return n == 0 ? x.a : n == 1 ? x.b : x.c;
  }
  double tolerance_s() const noexcept { return 1e-9 * period_s_; }
  double leg_a(std::size_t n, const PhaseValues& i, const PhaseValues& v) const noexcept {
    return p_.place == ShuntPlace::kLowSide && of(v, n) > 0.0 ? 0.0 : of(i, n);
  }
  /// Two conversions: the third channel has nothing.
  static double link_a(std::size_t n, const PhaseValues& i, const PhaseValues& v) noexcept {
    if (n == 2) return 0.0;
    return (v.a > 0.0 ? i.a : 0.0) + (v.b > 0.0 ? i.b : 0.0) + (v.c > 0.0 ? i.c : 0.0);
  }

  ShuntParameters p_;
  double period_s_;
  std::array<double, 3> instant_s_{};
};

}  // namespace drivebench
