#pragma once

#include <array>
#include <tuple>

#include "clients/control/estimators/linear_observer.hpp"
#include "clients/control/gains/gains.hpp"

namespace drivebench::control {

/// Injection of the angle error into the observers below.
struct ShaftObserverGains {
  double angle_per_s;        ///< l1
  double speed_per_s2;       ///< l2
  double load_per_s3 = 0.0;  ///< l3, of the load observer alone

  /// Poles −p1, −p2: l1 = p1 + p2 − f/J, l2 = p1·p2 − l1·f/J.
  static constexpr ShaftObserverGains placed(const std::array<double, 2>& p_per_s,
                                             double friction_rate_per_s) noexcept {
    const Polynomial<2> c = placed_polynomial(p_per_s);
    const double l1 = c[0] - friction_rate_per_s;
    return {.angle_per_s = l1, .speed_per_s2 = c[1] - l1 * friction_rate_per_s};
  }
  /// Poles −p1, −p2, −p3: the same from their polynomial, and l3 = −p1·p2·p3.
  static constexpr ShaftObserverGains placed(const std::array<double, 3>& p_per_s,
                                             double friction_rate_per_s) noexcept {
    const Polynomial<3> c = placed_polynomial(p_per_s);
    const double l1 = c[0] - friction_rate_per_s;
    return {.angle_per_s = l1, .speed_per_s2 = c[1] - l1 * friction_rate_per_s, .load_per_s3 = -c[2]};
  }

  static constexpr std::tuple kGains{gain("angle_per_s", &ShaftObserverGains::angle_per_s),
                                     gain("speed_per_s2", &ShaftObserverGains::speed_per_s2),
                                     gain("load_per_s3", &ShaftObserverGains::load_per_s3)};
};

/// Angle θ̂ and speed ω̂ from the angle and the acceleration that the machine's torque gives to J:
///   dθ̂/dt = ω̂ + l1·(θ − θ̂)        dω̂/dt = α_motor − (f/J)·ω̂ + l2·(θ − θ̂)
/// A load that it knows nothing of, τ_L, leaves ω̂ − ω = l1·τ_L/(J·p1·p2). Source: the book, 2.5
/// (EST-02).
LinearSystem<2, 1> shaft_observer(const ShaftObserverGains& gains, double friction_rate_per_s) noexcept;

/// The same with the load over the inertia as a third state, constant:
///   dω̂/dt = α_motor − (f/J)·ω̂ − τ̂_L/J + l2·(θ − θ̂)        d(τ̂_L/J)/dt = l3·(θ − θ̂)
/// The error's polynomial ends in −l3: only a negative l3 is stable (the book's problem says nothing of the
/// sign). Source: the book, problem 2.13 (EST-03).
LinearSystem<3, 1> load_observer(const ShaftObserverGains& gains, double friction_rate_per_s) noexcept;

}  // namespace drivebench::control
