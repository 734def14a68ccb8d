#include "plant/machines/bldc/bldc_machine.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace drivebench {
namespace {

ThreePhase phases(const BldcMachineState& x) noexcept {
  const ThreePhase star = two_to_three({x.i_a_a, x.i_b_a});
  const double common = frames_detail::kRootThird * x.i_zero_a;
  return {.a = star.a + common, .b = star.b + common, .c = star.c + common};
}

BldcMachineState coordinates(const ThreePhase& x) noexcept {
  const TwoPhase stator = three_to_two(x);
  return {.i_a_a = stator.a, .i_b_a = stator.b, .i_zero_a = bldc_detail::zero_sequence(x)};
}

/// Flux linkage of a phase over e_p/n_p, `turns` from the middle of the positive top of e: minus the integral
/// of e over the electrical angle. Straight under the tops, with caps of parabolas 5 pi/12 high.
double linkage(double turns) noexcept {
  constexpr double kPi = std::numbers::pi;
  const double from_zero = turns - std::floor(turns + 0.5);
  const double distance = std::abs(from_zero);
  const double straight = 2.0 * kPi * std::min(distance, 0.5 - distance);
  const double from_cap = distance - 0.25;
  const double cap = 5.0 / 12.0 * kPi - 12.0 * kPi * from_cap * from_cap;
  return std::copysign(std::abs(from_cap) < 1.0 / 12.0 ? cap : straight, -from_zero);
}

}  // namespace

BldcMachineConstants constants_of(const BldcMachineParameters& p) noexcept {
  const double inductance_h = p.self_inductance_h + p.mutual_inductance_h;
  const double zero_inductance_h = p.self_inductance_h - 2.0 * p.mutual_inductance_h;
  return {.pole_pairs = static_cast<double>(p.pole_pairs),
          .turns_per_rad = p.pole_pairs / (2.0 * std::numbers::pi),
          .stator_resistance_ohm = p.stator_resistance_ohm,
          .torque_constant_nm_per_a = p.torque_constant_nm_per_a,
          .mutual_inductance_h = p.mutual_inductance_h,
          .inductance_h = inductance_h,
          .reluctance_per_h = 1.0 / inductance_h,
          .zero_inductance_h = zero_inductance_h,
          .zero_reluctance_per_h = p.star ? 0.0 : 1.0 / zero_inductance_h,
          .star = p.star};
}

/// The inverse of the inductances of m conducting phases is (I + M/(L_S + M - m M) 11')/(L_S + M).
BldcMachineState bldc_detail::slope_of_conducting(const BldcMachineConstants& c,
                                                  const BldcMachineState& driving_v,
                                                  const ThreePhase& conducts) noexcept {
  const ThreePhase v = phases(driving_v);
  const double count = conducts.a + conducts.b + conducts.c;
  const double sum_v = conducts.a * v.a + conducts.b * v.b + conducts.c * v.c;
  const double coupled_v = c.mutual_inductance_h / (c.inductance_h - count * c.mutual_inductance_h) * sum_v;
  return coordinates({.a = conducts.a * c.reluctance_per_h * (v.a + coupled_v),
                      .b = conducts.b * c.reluctance_per_h * (v.b + coupled_v),
                      .c = conducts.c * c.reluctance_per_h * (v.c + coupled_v)});
}

double neutral_voltage_v(const BldcMachineConstants& c, const BldcMachineState&, const RotorMotion& motion,
                         double mean_terminal_voltage_v) noexcept {
  return mean_terminal_voltage_v +
         c.torque_constant_nm_per_a * motion.speed_rad_s * neutral(back_emf_shape(c, motion.angle_rad));
}

BldcMachineState restricted(const BldcMachineConstants& c, const BldcMachineState& x, const RotorMotion&,
                            const TerminalInput& u) noexcept {
  if (c.star) {
    const TwoPhase current_a = conducted({x.i_a_a, x.i_b_a}, u);
    return {.i_a_a = current_a.a, .i_b_a = current_a.b, .i_zero_a = x.i_zero_a};
  }
  const ThreePhase current_a = phases(x);
  return coordinates(
      {.a = u.conducts.a * current_a.a, .b = u.conducts.b * current_a.b, .c = u.conducts.c * current_a.c});
}

WindingValues open_circuit_voltages(const BldcMachineConstants& c, const BldcMachineState&,
                                    const RotorMotion& motion) noexcept {
  const double emf_v = c.torque_constant_nm_per_a * motion.speed_rad_s;
  const ThreePhase e = back_emf_shape(c, motion.angle_rad);
  const TwoPhase stator_e = three_to_two(e);
  return {.stator = {.a = -emf_v * stator_e.a, .b = -emf_v * stator_e.b},
          .zero = c.star ? 0.0 : -emf_v * bldc_detail::zero_sequence(e)};
}

WindingValues winding_voltages(const BldcMachineConstants& c, const BldcMachineState& x,
                               const RotorMotion& motion, const TerminalInput& u) noexcept {
  const WindingValues emf_v = open_circuit_voltages(c, x, motion);
  const BldcMachineState slope = derivative(c, x, motion, u);
  const auto dropped_v = [&](double inductance_h, double i_a, double slope_a_s) {
    return c.stator_resistance_ohm * i_a + inductance_h * slope_a_s;
  };
  return {.stator = {.a = emf_v.stator.a + dropped_v(c.inductance_h, x.i_a_a, slope.i_a_a),
                     .b = emf_v.stator.b + dropped_v(c.inductance_h, x.i_b_a, slope.i_b_a)},
          .zero = emf_v.zero + dropped_v(c.zero_inductance_h, x.i_zero_a, slope.i_zero_a)};
}

TwoPhase rotor_flux_wb(const BldcMachineConstants& c, const BldcMachineState&,
                       const RotorMotion& motion) noexcept {
  const double turns = c.turns_per_rad * motion.angle_rad - 0.25;
  const TwoPhase flux =
      three_to_two({.a = linkage(turns), .b = linkage(turns - 1.0 / 3.0), .c = linkage(turns - 2.0 / 3.0)});
  const double scale_wb = c.torque_constant_nm_per_a / c.pole_pairs;
  return {.a = scale_wb * flux.a, .b = scale_wb * flux.b};
}

double stored_energy_j(const BldcMachineConstants& c, const BldcMachineState& x,
                       const RotorMotion&) noexcept {
  return 0.5 * c.inductance_h * (x.i_a_a * x.i_a_a + x.i_b_a * x.i_b_a) +
         0.5 * c.zero_inductance_h * x.i_zero_a * x.i_zero_a;
}

double losses_w(const BldcMachineConstants& c, const BldcMachineState& x, const RotorMotion&) noexcept {
  return c.stator_resistance_ohm * (x.i_a_a * x.i_a_a + x.i_b_a * x.i_b_a + x.i_zero_a * x.i_zero_a);
}

Connection connection_of(const BldcMachineParameters& p) noexcept {
  return p.star ? Connection::kStar : Connection::kIndependent;
}

double pole_pairs_of(const BldcMachineParameters& p) noexcept {
  return static_cast<double>(p.pole_pairs);
}

BldcMachineParameters adjusted(const BldcMachineParameters& p, const Adjustment& a) noexcept {
  BldcMachineParameters result = p;
  result.stator_resistance_ohm =
      p.stator_resistance_ohm * a.stator_resistance_factor + a.series_resistance_ohm;
  result.self_inductance_h = p.self_inductance_h + a.series_inductance_h;
  result.torque_constant_nm_per_a = p.torque_constant_nm_per_a * a.magnet_factor;
  return result;
}

double fastest_time_constant_s(const BldcMachineParameters& p) noexcept {
  const BldcMachineConstants c = constants_of(p);
  return (p.star ? c.inductance_h : std::min(c.inductance_h, c.zero_inductance_h)) / p.stator_resistance_ohm;
}

double electrical_speed_rad_s(const BldcMachineParameters& p, double voltage_v) noexcept {
  return p.torque_constant_nm_per_a > 0.0 ? p.pole_pairs * voltage_v / p.torque_constant_nm_per_a : 0.0;
}

}  // namespace drivebench
