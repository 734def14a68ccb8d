#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <random>

#include "plant/machines/bldc/bldc_machine.hpp"

/// The brushless motor of BL-05, phase by phase.
namespace drivebench::bldc_motor {

inline constexpr double kPi = std::numbers::pi;
inline constexpr double kDegree = kPi / 180.0;

inline constexpr BldcMachineParameters kMotor{.pole_pairs = 1,
                                              .stator_resistance_ohm = 0.7,
                                              .self_inductance_h = 2.72e-3,
                                              .mutual_inductance_h = 0.15e-3,
                                              .torque_constant_nm_per_a = 0.5128,
                                              .star = true};
inline constexpr double kInertia_kgm2 = 2e-4;
inline constexpr double kFriction_nms = 0.002;

using Phases = std::array<double, 3>;

inline RotorMotion motion(double angle_rad, double speed_rad_s = 0.0) {
  return {.angle_rad = angle_rad, .speed_rad_s = speed_rad_s, .electrical = {1.0, 0.0}};
}

inline BldcMachineParameters independent(BldcMachineParameters p = kMotor) {
  p.star = false;
  return p;
}

inline BldcMachineState state_of(const Phases& i) {
  const TwoPhase stator = three_to_two({i[0], i[1], i[2]});
  return {.i_a_a = stator.a, .i_b_a = stator.b, .i_zero_a = (i[0] + i[1] + i[2]) / std::sqrt(3.0)};
}

inline Phases phases_of(const BldcMachineState& x) {
  const ThreePhase star = two_to_three({x.i_a_a, x.i_b_a});
  const double common = x.i_zero_a / std::sqrt(3.0);
  return {star.a + common, star.b + common, star.c + common};
}

inline TerminalInput input_of(const Phases& u) {
  return {.voltage_v = three_to_two({u[0], u[1], u[2]}), .zero_v = (u[0] + u[1] + u[2]) / std::sqrt(3.0)};
}

inline double sum(const Phases& x) {
  return x[0] + x[1] + x[2];
}

/// e of the book, (10.8), angle by angle.
inline double book_shape(double electrical_rad) {
  const double degrees = electrical_rad / kDegree - 360.0 * std::floor(electrical_rad / kDegree / 360.0);
  if (degrees < 30.0) return degrees / 30.0;
  if (degrees < 150.0) return 1.0;
  if (degrees < 210.0) return (180.0 - degrees) / 30.0;
  if (degrees < 330.0) return -1.0;
  return (degrees - 360.0) / 30.0;
}

struct Random {
  std::mt19937_64 engine;
  double operator()(double size) { return std::uniform_real_distribution<double>(-size, size)(engine); }
  Phases three(double size) { return {(*this)(size), (*this)(size), (*this)(size)}; }
};

inline BldcMachineState without_neutral_current(const BldcMachineState& x) {
  return {.i_a_a = x.i_a_a, .i_b_a = x.i_b_a};
}

}  // namespace drivebench::bldc_motor
