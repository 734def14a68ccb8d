#pragma once

#include <algorithm>
#include <cmath>
#include "plant/windings.hpp"

namespace drivebench {

/// Brushless DC machine with trapezoidal back-emf: three phases, in an isolated star or each on its own.
struct BldcMachineParameters {
  int pole_pairs = 1;
  double stator_resistance_ohm = 0.0;     ///< per phase
  double self_inductance_h = 0.0;         ///< L_S of a phase
  double mutual_inductance_h = 0.0;       ///< M; a phase links the flux -M i of another one
  double torque_constant_nm_per_a = 0.0;  ///< tau_p = e_p of a phase at the flat top, n_p included [V·s/rad]
  bool star = true;                       ///< isolated star; else three independent phases
};

/// The constants that the equations use, derived once from the parameters.
struct BldcMachineConstants {
  double pole_pairs;
  double turns_per_rad;             ///< electrical turns per angle of the shaft, n_p/(2 pi)
  double stator_resistance_ohm;     ///< R_S
  double torque_constant_nm_per_a;  ///< tau_p = e_p
  double mutual_inductance_h;       ///< M
  double inductance_h;              ///< L_S + M, of the two-phase currents
  double reluctance_per_h;          ///< 1/(L_S + M)
  double zero_inductance_h;         ///< L_S - 2M, of the zero sequence
  double zero_reluctance_per_h;     ///< 1/(L_S - 2M); 0 in a star, where no zero sequence flows
  bool star;
};

/// The constants of a machine whose parameters are free of problems().
BldcMachineConstants constants_of(const BldcMachineParameters& p) noexcept;

/// Stator currents: two-phase, and the zero sequence, which stays zero in a star.
struct BldcMachineState {
  double i_a_a = 0.0;
  double i_b_a = 0.0;
  double i_zero_a = 0.0;
};

namespace bldc_detail {

/// e over `turns`, electrical turns from the middle of its positive top: a triangle of height 3 cut off at
/// one. At a corner both sides give the same value, so it does not matter on which one rounding falls.
inline double trapezoid(double turns) noexcept {
  constexpr double kShift = 0x1.8p52;  // adding it rounds to an integer
  const double distance = std::abs(turns - ((turns + kShift) - kShift));
  return std::min(1.0, std::max(-1.0, 3.0 - 12.0 * distance));
}

inline double zero_sequence(const ThreePhase& x) noexcept {
  return frames_detail::kRootThird * (x.a + x.b + x.c);
}

/// The slopes with one or more phases open, from what drives the currents.
BldcMachineState slope_of_conducting(const BldcMachineConstants& c, const BldcMachineState& driving_v,
                                     const ThreePhase& conducts) noexcept;

}  // namespace bldc_detail

/// e(n_p theta), e(n_p theta - 120 deg), e(n_p theta + 120 deg): e is 0 at 0, rises to 1 at 30 degrees, falls
/// from 150 degrees to -1 at 210. It has the sense of the terminal voltage: the back-emf of the literature,
/// which opposes it, is -e. Source: the book, (10.7)-(10.8).
inline ThreePhase back_emf_shape(const BldcMachineConstants& c, double angle_rad) noexcept {
  const double turns = c.turns_per_rad * angle_rad - 0.25;
  return {.a = bldc_detail::trapezoid(turns),
          .b = bldc_detail::trapezoid(turns - 1.0 / 3.0),
          .c = bldc_detail::trapezoid(turns - 2.0 / 3.0)};
}

/// Phases k = 1, 2, 3, motor convention, rotation positive from phase a to phase b, no saturation:
///   L_S i_k' - M (sum of the other i') = u_k - v_N - R_S i_k + e_p w e(n_p theta - (k-1) 2 pi/3)
/// A star has sum i_k = 0, which v_N sees to: see neutral_voltage_v(). Independent phases have v_N = 0. The
/// two-phase currents see L_S + M, the zero sequence L_S - 2M. Source: the book, chapter 10.
// Always inline: else clang works out the emf twice per stage, once more in torque_nm().
[[gnu::always_inline]] inline BldcMachineState derivative(const BldcMachineConstants& c,
                                                          const BldcMachineState& x,
                                                          const RotorMotion& motion,
                                                          const TerminalInput& u) noexcept {
  const double emf_v = c.torque_constant_nm_per_a * motion.speed_rad_s;
  const ThreePhase e = back_emf_shape(c, motion.angle_rad);
  const TwoPhase stator_e = three_to_two(e);
  const TwoPhase driving_v{.a = u.voltage_v.a - c.stator_resistance_ohm * x.i_a_a + emf_v * stator_e.a,
                           .b = u.voltage_v.b - c.stator_resistance_ohm * x.i_b_a + emf_v * stator_e.b};
  if (c.star) {
    const TwoPhase slope = conducted({driving_v.a * c.reluctance_per_h, driving_v.b * c.reluctance_per_h}, u);
    return {.i_a_a = slope.a, .i_b_a = slope.b, .i_zero_a = 0.0};
  }
  const double zero_v =
      u.zero_v - c.stator_resistance_ohm * x.i_zero_a + emf_v * bldc_detail::zero_sequence(e);
  if (u.conducts.a + u.conducts.b + u.conducts.c != 3.0) {
    return bldc_detail::slope_of_conducting(c, {driving_v.a, driving_v.b, zero_v}, u.conducts);
  }
  return {.i_a_a = driving_v.a * c.reluctance_per_h,
          .i_b_a = driving_v.b * c.reluctance_per_h,
          .i_zero_a = zero_v * c.zero_reluctance_per_h};
}

/// Torque on the rotor: -tau_p sum e_k i_k. A motor takes currents of the sign opposite to e.
inline double torque_nm(const BldcMachineConstants& c, const BldcMachineState& x,
                        const RotorMotion& motion) noexcept {
  const ThreePhase e = back_emf_shape(c, motion.angle_rad);
  const TwoPhase stator_e = three_to_two(e);
  double sum_a = stator_e.a * x.i_a_a + stator_e.b * x.i_b_a;
  if (!c.star) sum_a += bldc_detail::zero_sequence(e) * x.i_zero_a;
  return -c.torque_constant_nm_per_a * sum_a;
}

inline WindingValues winding_currents(const BldcMachineConstants&, const BldcMachineState& x,
                                      const RotorMotion&) noexcept {
  return {.stator = {x.i_a_a, x.i_b_a}, .zero = x.i_zero_a};
}

/// Passes an integer exactly where the slope of the back-emf of a phase jumps: at 30 degrees electrical and
/// every 60 degrees on.
inline double corner_position(const BldcMachineConstants& c, double angle_rad) noexcept {
  return 6.0 * (c.turns_per_rad * angle_rad) - 0.5;
}

/// Voltage of the neutral of a star from the mean of its terminal voltages, both against the same point:
/// v_N = (sum u_k + e_p w sum e_k)/3, whichever phases conduct.
double neutral_voltage_v(const BldcMachineConstants& c, const BldcMachineState& x, const RotorMotion& motion,
                         double mean_terminal_voltage_v) noexcept;

/// The state with the part of the stator current removed that the circuit does not let flow.
BldcMachineState restricted(const BldcMachineConstants& c, const BldcMachineState& x,
                            const RotorMotion& motion, const TerminalInput& u) noexcept;

/// Voltages of the windings where no current flows and none changes; zero only for independent phases.
WindingValues open_circuit_voltages(const BldcMachineConstants& c, const BldcMachineState& x,
                                    const RotorMotion& motion) noexcept;

/// Voltages of the windings with the currents that `u` lets flow: R i + d(flux)/dt. An open
/// phase of independent ones shows its voltage while the others carry current.
WindingValues winding_voltages(const BldcMachineConstants& c, const BldcMachineState& x,
                               const RotorMotion& motion, const TerminalInput& u) noexcept;

/// The voltages of open windings while the others carry the currents that `u` lets flow, which cancel there
/// in a star.
inline WindingValues floating_voltages(const BldcMachineConstants& c, const BldcMachineState& x,
                                       const RotorMotion& motion, const TerminalInput& u) noexcept {
  return c.star ? open_circuit_voltages(c, x, motion) : winding_voltages(c, x, motion, u);
}

/// Flux linkage that the magnet gives the stator: that of phase a peaks at angle 0.
TwoPhase rotor_flux_wb(const BldcMachineConstants& c, const BldcMachineState& x,
                       const RotorMotion& motion) noexcept;

/// Magnetic energy of the currents: (L_S + M)|i|^2/2 + (L_S - 2M) i_0^2/2.
double stored_energy_j(const BldcMachineConstants& c, const BldcMachineState& x,
                       const RotorMotion& motion) noexcept;

/// Copper losses: R_S sum i_k^2.
double losses_w(const BldcMachineConstants& c, const BldcMachineState& x, const RotorMotion& motion) noexcept;

Connection connection_of(const BldcMachineParameters& p) noexcept;
/// Turns of the electrical angle for one of the shaft.
double pole_pairs_of(const BldcMachineParameters& p) noexcept;
BldcMachineParameters adjusted(const BldcMachineParameters& p, const Adjustment& a) noexcept;
/// The fastest electrical time constant, L/R_S of the smallest inductance that carries current.
double fastest_time_constant_s(const BldcMachineParameters& p) noexcept;

/// Electrical angular speed at which the emf reaches a voltage; 0 without a magnet.
double electrical_speed_rad_s(const BldcMachineParameters& p, double voltage_v) noexcept;

/// Names the parts of the machine for the templates of plant/train/drive_train.hpp.
struct BldcMachine {
  using Parameters = BldcMachineParameters;
  using Constants = BldcMachineConstants;
  using State = BldcMachineState;
  static constexpr bool kUsesAngle = false;  ///< they read RotorMotion.angle_rad, but not its cosine and sine
  static constexpr bool kHasCorners = true;  ///< see corner_position()
  static MachineKind kind() noexcept;
};

}  // namespace drivebench
