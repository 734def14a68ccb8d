#include "plant/machines/wound_rotor/wound_rotor_machine.hpp"

#include <cmath>

#include "plant/math/length.hpp"

namespace drivebench {

double leakage_factor(const WoundRotorMachineParameters& p) noexcept {
  return 1.0 - p.mutual_inductance_h * p.mutual_inductance_h / (p.field_inductance_h * p.stator_inductance_h);
}

WoundRotorMachineConstants constants_of(const WoundRotorMachineParameters& p) noexcept {
  return {.pole_pairs = static_cast<double>(p.pole_pairs),
          .stator_resistance_ohm = p.stator_resistance_ohm,
          .field_resistance_ohm = p.field_resistance_ohm,
          .stator_inductance_h = p.stator_inductance_h,
          .field_inductance_h = p.field_inductance_h,
          .mutual_inductance_h = p.mutual_inductance_h,
          .stator_reluctance_per_h = 1.0 / p.stator_inductance_h,
          .coupling = p.mutual_inductance_h / p.stator_inductance_h};
}

WoundRotorMachineState restricted(const WoundRotorMachineConstants& c, const WoundRotorMachineState& x,
                                  const RotorMotion& motion, const TerminalInput& u) noexcept {
  const TwoPhase current_a = conducted({x.i_a_a, x.i_b_a}, u);
  const double taken_along_field_a =
      (x.i_a_a - current_a.a) * motion.electrical.cos + (x.i_b_a - current_a.b) * motion.electrical.sin;
  return {.i_a_a = current_a.a,
          .i_b_a = current_a.b,
          .i_field_a = x.i_field_a + c.mutual_inductance_h / c.field_inductance_h * taken_along_field_a};
}

WindingValues open_circuit_voltages(const WoundRotorMachineConstants& c, const WoundRotorMachineState& x,
                                    const RotorMotion& motion) noexcept {
  const double emf_v = c.pole_pairs * motion.speed_rad_s * c.mutual_inductance_h * x.i_field_a;
  return {.stator = {-emf_v * motion.electrical.sin, emf_v * motion.electrical.cos},
          .field = c.field_resistance_ohm * x.i_field_a};
}

WindingValues open_circuit_voltages(const WoundRotorMachineConstants& c, const WoundRotorMachineState& x,
                                    const RotorMotion& motion, double field_v) noexcept {
  WindingValues v = open_circuit_voltages(c, x, motion);
  const double induced_v =
      c.mutual_inductance_h / c.field_inductance_h * (field_v - c.field_resistance_ohm * x.i_field_a);
  v.stator.a += induced_v * motion.electrical.cos;
  v.stator.b += induced_v * motion.electrical.sin;
  v.field = field_v;
  return v;
}

WindingValues winding_voltages(const WoundRotorMachineConstants& c, const WoundRotorMachineState& x,
                               const RotorMotion& motion, const TerminalInput& u) noexcept {
  const WoundRotorMachineState slope = derivative(c, x, motion, u);
  const TwoPhase emf_v = open_circuit_voltages(c, x, motion).stator;
  const double induced_v = c.mutual_inductance_h * slope.i_field_a;
  return {.stator = {c.stator_resistance_ohm * x.i_a_a + c.stator_inductance_h * slope.i_a_a +
                         induced_v * motion.electrical.cos + emf_v.a,
                     c.stator_resistance_ohm * x.i_b_a + c.stator_inductance_h * slope.i_b_a +
                         induced_v * motion.electrical.sin + emf_v.b},
          .field = u.field_v};
}

TwoPhase rotor_flux_wb(const WoundRotorMachineConstants& c, const WoundRotorMachineState& x,
                       const RotorMotion& motion) noexcept {
  const double flux_wb = c.mutual_inductance_h * x.i_field_a;
  return {.a = flux_wb * motion.electrical.cos, .b = flux_wb * motion.electrical.sin};
}

double stored_energy_j(const WoundRotorMachineConstants& c, const WoundRotorMachineState& x,
                       const RotorMotion& motion) noexcept {
  const double i_d_a = x.i_a_a * motion.electrical.cos + x.i_b_a * motion.electrical.sin;
  return 0.5 * c.stator_inductance_h * (x.i_a_a * x.i_a_a + x.i_b_a * x.i_b_a) +
         (0.5 * c.field_inductance_h * x.i_field_a + c.mutual_inductance_h * i_d_a) * x.i_field_a;
}

double losses_w(const WoundRotorMachineConstants& c, const WoundRotorMachineState& x,
                const RotorMotion&) noexcept {
  return c.stator_resistance_ohm * (x.i_a_a * x.i_a_a + x.i_b_a * x.i_b_a) +
         c.field_resistance_ohm * x.i_field_a * x.i_field_a;
}

Connection connection_of(const WoundRotorMachineParameters& p) noexcept {
  return p.star ? Connection::kStar : Connection::kTwoPhase;
}

double pole_pairs_of(const WoundRotorMachineParameters& p) noexcept {
  return static_cast<double>(p.pole_pairs);
}

WoundRotorMachineParameters adjusted(const WoundRotorMachineParameters& p, const Adjustment& a) noexcept {
  WoundRotorMachineParameters result = p;
  result.stator_resistance_ohm =
      p.stator_resistance_ohm * a.stator_resistance_factor + a.series_resistance_ohm;
  result.field_resistance_ohm = p.field_resistance_ohm * a.rotor_resistance_factor;
  result.stator_inductance_h = p.stator_inductance_h + a.series_inductance_h;
  return result;
}

double fastest_time_constant_s(const WoundRotorMachineParameters& p) noexcept {
  // The larger root of s^2 - (r_S + r_F)/sigma s + r_S r_F/sigma = 0 with r = R/L of stator and field.
  const double sigma = leakage_factor(p);
  const double r_s = p.stator_resistance_ohm / p.stator_inductance_h;
  const double r_f = p.field_resistance_ohm / p.field_inductance_h;
  const double half = 0.5 * (r_s + r_f) / sigma;
  return 1.0 / (half + std::sqrt(half * half - r_s * r_f / sigma));
}

double swing_rad_s(const WoundRotorMachineParameters& p, double inertia_kgm2, double amplitude_v,
                   double electrical_rad_s, double field_v) noexcept {
  const double field_a = std::abs(field_v) / p.field_resistance_ohm;
  const double stator_a =
      std::abs(amplitude_v) /
      length(p.stator_resistance_ohm, electrical_rad_s * leakage_factor(p) * p.stator_inductance_h);
  return p.pole_pairs * std::sqrt(p.mutual_inductance_h * field_a * stator_a / inertia_kgm2);
}

}  // namespace drivebench
