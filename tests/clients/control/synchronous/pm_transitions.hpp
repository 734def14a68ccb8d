#pragma once

#include <cmath>
#include <stdexcept>
#include <vector>

#include "clients/control/synchronous/optimum_torque_pm.hpp"

// The closed forms that the book has for the limits of a PM machine; the product tries the limits instead.
namespace drivebench::control {

/// Speeds at which the limit that decides changes, for positive speed; motoring is a positive torque.
struct PmTransitions {
  double first_motoring_rad_s;  ///< current alone below, both limits above
  double first_braking_rad_s;
  std::vector<double> second_motoring_rad_s;  ///< both limits below, voltage alone above, and again if two
  std::vector<double> second_braking_rad_s;
};

/// The root of f between two points where it has different signs.
template <class F>
double root_between(double low, double high, F f) {
  const bool rises = f(high) > 0.0;
  for (int k = 0; k < 200 && high - low > 1e-15 * high; ++k) {
    const double middle = 0.5 * (low + high);
    ((f(middle) > 0.0) == rises ? high : low) = middle;
  }
  return 0.5 * (low + high);
}

/// A point beyond `low` where f is positive, as it is in the end.
template <class F>
double positive_beyond(double low, F f) {
  double x = 2.0 * low + 1.0;
  while (!(f(x) > 0.0))
    x *= 2.0;
  return x;
}

/// First speeds, with + for motoring:
///   (K_m² + (n_p·L_S·I)²)·ω² ± 2·R_S·K_m·I·ω + R_S²·I² = V²
/// Second speeds, x = ω², D = (n_p·L_S·I)² − K_m², A = V² − R_S²·I²:
///   (D·x − A)²·(x + (R_S/(n_p·L_S))²) = (2·K_m·R_S·V/(n_p·L_S))²·x
/// of which roots with D·x < A are those of motoring. Needs V > R_S·I; throws std::invalid_argument.
/// Source: the book, (9.82) with the terms that the print lacks, (9.88)-(9.94) (PMT-05).
inline PmTransitions transition_speeds(const PmMachineModel& p, const PmLimits& limits) {
  const double v = limits.voltage_v;
  const double i = limits.current_a;
  const double k = p.torque_constant_nm_per_a;
  const double nl = p.pole_pairs * p.inductance_h;
  const double a = v * v - p.resistance_ohm * p.resistance_ohm * i * i;
  if (!(a > 0.0)) throw std::invalid_argument("the voltage limit must exceed resistance times current limit");

  PmTransitions result{};
  const double square = k * k + nl * nl * i * i;
  const double half = p.resistance_ohm * k * i;
  const double root = std::sqrt(half * half + square * a);
  result.first_motoring_rad_s = (root - half) / square;
  result.first_braking_rad_s = (root + half) / square;

  const double d = nl * nl * i * i - k * k;
  const double b = p.resistance_ohm * p.resistance_ohm / (nl * nl);
  const double c = 4.0 * k * k * b * v * v;
  const auto f = [&](double x) { return (d * x - a) * (d * x - a) * (x + b) - c * x; };
  const auto slope = [&](double x) {
    return 2.0 * d * (d * x - a) * (x + b) + (d * x - a) * (d * x - a) - c;
  };
  const auto speed_between = [&f](double low, double high) { return std::sqrt(root_between(low, high, f)); };
  if (d > 0.0) {
    // f is positive at 0, negative at a/d and positive in the end.
    result.second_motoring_rad_s.push_back(speed_between(0.0, a / d));
    result.second_braking_rad_s.push_back(speed_between(a / d, positive_beyond(a / d, f)));
  } else if (slope(0.0) < 0.0) {
    // f is convex for positive x and positive at 0: none or two, or one if it is a straight line.
    const double least =
        d < 0.0 ? root_between(0.0, positive_beyond(0.0, slope), slope) : -2.0 * a * a * b / slope(0.0);
    if (f(least) < 0.0) {
      result.second_motoring_rad_s.push_back(speed_between(0.0, least));
      if (d < 0.0) result.second_motoring_rad_s.push_back(speed_between(least, positive_beyond(least, f)));
    }
  }
  return result;
}

}  // namespace drivebench::control
