#pragma once

#include <algorithm>
#include <cmath>

#include "plant/math/rk4.hpp"
#include "plant/windings.hpp"

/// The power and the energy of any kind of machine: what goes in, what is stored, lost and delivered.
namespace drivebench {

template <class Constants>
RotorMotion motion_at(const Constants& c, double angle_rad, double speed_rad_s) {
  double pole_pairs = 1.0;
  if constexpr (requires { c.pole_pairs; }) pole_pairs = c.pole_pairs;
  return {.angle_rad = angle_rad, .speed_rad_s = speed_rad_s, .electrical = cos_sin(pole_pairs * angle_rad)};
}

/// Power into a machine at its windings.
template <class Constants, class State>
double input_w(const Constants& c, const State& x, const RotorMotion& motion, const TerminalInput& u) {
  const WindingValues i = winding_currents(c, x, motion);
  return u.voltage_v.a * i.stator.a + u.voltage_v.b * i.stator.b + u.zero_v * i.zero + u.field_v * i.field;
}

/// The same without signs: what the windings exchange with the outside, even if it cancels.
template <class Constants, class State>
double exchanged_w(const Constants& c, const State& x, const RotorMotion& motion, const TerminalInput& u) {
  const WindingValues i = winding_currents(c, x, motion);
  return std::abs(u.voltage_v.a * i.stator.a) + std::abs(u.voltage_v.b * i.stator.b) +
         std::abs(u.zero_v * i.zero) + std::abs(u.field_v * i.field);
}

/// Rate of the stored energy along a slope while the rotor turns. Where a magnet or a field turns, by a
/// fourth-order difference, in whose steps neither angle nor currents change by much more than 1e-3 of their
/// size, for an error near 1e-12; else the energy is piecewise quadratic, of which a central difference is
/// the exact derivative between two kinks.
template <class Constants, class State>
double storing_w(const Constants& c, const State& x, const RotorMotion& motion, const State& slope) {
  const auto energy_j = [&](double dt) {
    return stored_energy_j(c, advanced(x, dt, slope),
                           motion_at(c, motion.angle_rad + dt * motion.speed_rad_s, motion.speed_rad_s));
  };
  const auto rise_j = [&](double dt) { return energy_j(dt) - energy_j(-dt); };
  if constexpr (requires { c.pole_pairs; }) {
    const double step_s = 1e-3 / (c.pole_pairs * std::abs(motion.speed_rad_s) + 5000.0);
    return (8.0 * rise_j(step_s) - rise_j(2.0 * step_s)) / (12.0 * step_s);
  } else {
    constexpr double kStep_s = 1e-7;
    return rise_j(kStep_s) / (2.0 * kStep_s);
  }
}

/// The part of the input power that is neither stored, nor lost, nor delivered to the shaft, relative to the
/// largest of these powers; for any given slope and torque.
template <class Constants, class State>
double unbalanced(const Constants& c, const State& x, const RotorMotion& motion, const TerminalInput& u,
                  const State& slope, double torque) {
  const double in_w = input_w(c, x, motion, u);
  const double stored_w = storing_w(c, x, motion, slope);
  const double lost_w = losses_w(c, x, motion);
  const double shaft_w = torque * motion.speed_rad_s;
  return std::abs(in_w - stored_w - lost_w - shaft_w) /
         std::max({exchanged_w(c, x, motion, u), std::abs(stored_w), lost_w, std::abs(shaft_w), 1e-9});
}

/// The same of the machine itself.
template <class Constants, class State>
double unbalanced(const Constants& c, const State& x, const RotorMotion& motion, const TerminalInput& u) {
  return unbalanced(c, x, motion, u, derivative(c, x, motion, u), torque_nm(c, x, motion));
}

}  // namespace drivebench
