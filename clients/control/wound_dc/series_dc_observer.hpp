#pragma once

#include <array>
#include <cstdint>
#include <tuple>

#include "clients/control/estimators/linear_observer.hpp"
#include "clients/control/gains/gains.hpp"
#include "clients/models/wound_dc_machine.hpp"

namespace drivebench::control {

/// Injection of the error of ln λ_f.
struct SeriesDcObserverGains {
  double flux_per_s;         ///< l1
  double speed_per_s2;       ///< l2 [rad/s²]
  double load_per_s3 = 0.0;  ///< l3 [rad/s³]; 0: no load is estimated (EST-05)

  /// Poles −p1, −p2, without a load: l1 = Σp − f/J, l2 = (l1·f/J − p1·p2)/K_m.
  static constexpr SeriesDcObserverGains placed(const std::array<double, 2>& p_per_s,
                                                const WoundDcModel& m) noexcept {
    const Polynomial<2> c = placed_polynomial(p_per_s);
    const double l1 = c[0] - m.friction_rate_per_s();
    return {.flux_per_s = l1, .speed_per_s2 = (l1 * m.friction_rate_per_s() - c[1]) / m.motor_constant};
  }
  /// Poles −p1, −p2, −p3: the same from their polynomial, and l3 = p1·p2·p3/K_m.
  static constexpr SeriesDcObserverGains placed(const std::array<double, 3>& p_per_s,
                                                const WoundDcModel& m) noexcept {
    const Polynomial<3> c = placed_polynomial(p_per_s);
    const double l1 = c[0] - m.friction_rate_per_s();
    return {.flux_per_s = l1,
            .speed_per_s2 = (l1 * m.friction_rate_per_s() - c[1]) / m.motor_constant,
            .load_per_s3 = c[2] / m.motor_constant};
  }

  static constexpr std::tuple kGains{gain("flux_per_s", &SeriesDcObserverGains::flux_per_s),
                                     gain("speed_per_s2", &SeriesDcObserverGains::speed_per_s2),
                                     gain("load_per_s3", &SeriesDcObserverGains::load_per_s3)};
};

/// Speed and load of an unsaturated series motor from its current and voltage alone. With z = (ln λ_f, ω,
/// τ_L/J) the equations are linear in what is not measured:
///   d(ln λ_f)/dt = (v − (R + R_f)·i)/λ_f − K_m·ω        dω/dt = (K_m/J)·λ_f·i − (f/J)·ω − τ_L/J
/// The armature's own inductance, which the book neglects, makes the left side (1 + L/L_f)·d(ln λ_f)/dt.
/// Nothing can be seen without current: below `least_current_a` the estimates stand still. Source: the book,
/// problems 2.44 and 2.45 (EST-05, EST-06).
class SeriesDcObserver {
 public:
  SeriesDcObserver(const WoundDcModel& model, const SeriesDcObserverGains& gains, double least_current_a,
                   double period_s, Discretisation how) noexcept;

  /// One sample; `voltage_v` has been in force since the one before.
  void update(double current_a, double voltage_v, std::int64_t periods) noexcept;

  double speed_rad_s() const noexcept { return speed_rad_s_; }
  double load_nm() const noexcept { return model_.inertia_kgm2 * load_rad_s2_; }
  /// Whether the error dies out at this sample rate.
  bool stable() const { return observer_.stable(); }

 private:
  std::array<double, 2> inputs(double current_a, double voltage_v) const noexcept;

  WoundDcModel model_;
  double least_current_a_;
  double log_share_;  // 1 + L/L_f
  LinearObserver<3, 2> observer_;
  bool running_ = false;
  double last_current_a_ = 0.0;
  double speed_rad_s_ = 0.0;
  double load_rad_s2_ = 0.0;
};

/// The equations above: inputs are what is measured of both derivatives, the output is (1 + L/L_f)·ln λ_f.
LinearSystem<3, 2> series_dc_observer(const WoundDcModel& model, const SeriesDcObserverGains& gains) noexcept;

}  // namespace drivebench::control
