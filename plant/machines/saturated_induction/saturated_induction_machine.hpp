#pragma once

#include <cmath>
#include <span>
#include "plant/math/curve.hpp"
#include "plant/windings.hpp"

namespace drivebench {

/// Two-phase equivalent of a squirrel-cage induction machine (power-invariant transform) whose magnetising
/// flux saturates; the leakages do not.
struct SaturatedInductionMachineParameters {
  int pole_pairs = 1;
  double stator_resistance_ohm = 0.0;
  double rotor_resistance_ohm = 0.0;
  double stator_leakage_h = 0.0;  ///< l_s; L_S of the unsaturated machine is l_s + M
  double rotor_leakage_h = 0.0;   ///< l_r
  /// Magnetising flux linkage [Wb] over magnetising current [A], both the lengths of two-phase vectors, from
  /// (0, 0) on. Its slope is M.
  Curve magnetising_curve;
  bool star = false;  ///< three phases in an isolated star, given by their two-phase equivalent; else two
};

/// The constants that the equations use, derived once from the parameters.
struct SaturatedInductionMachineConstants {
  double pole_pairs;
  double stator_resistance_ohm;  ///< R_S
  double rotor_resistance_ohm;   ///< R_R
  double stator_leakage_h;       ///< l_s
  double rotor_leakage_h;        ///< l_r
  double stator_leakage_per_h;   ///< 1/l_s
  double rotor_leakage_per_h;    ///< 1/l_r
  double parallel_leakage_h;     ///< 1/(1/l_s + 1/l_r)
  Curve magnetising_curve;
  std::span<const CurvePoint> points;  ///< of the curve
};

/// The constants of a machine whose parameters are free of problems().
SaturatedInductionMachineConstants constants_of(const SaturatedInductionMachineParameters& p) noexcept;

/// Flux linkages of stator and rotor, all in the stator frame (axes a, b).
struct SaturatedInductionMachineState {
  double stator_a_wb = 0.0;
  double stator_b_wb = 0.0;
  double rotor_a_wb = 0.0;
  double rotor_b_wb = 0.0;
};

namespace saturation_detail {

/// The first point of the segment on which lambda_m/leakage_h + i_m(lambda_m) = total_a. Pure, so that torque
/// and slope at the same state share one search.
[[gnu::pure]] const CurvePoint* segment(std::span<const CurvePoint> points, double leakage_h,
                                        double total_a) noexcept;

/// Magnetising flux over total_a, and the change of the flux over that of total_a.
struct Inductances {
  double chord_h;
  double slope_h;
};

/// Solves lambda_m/leakage_h + i_m(lambda_m) = total_a: exactly, as the curve is piecewise linear.
inline Inductances inductances(std::span<const CurvePoint> points, double leakage_h,
                               double total_a) noexcept {
  const CurvePoint* from = segment(points, leakage_h, total_a);
  const double dx_a = from[1].x - from[0].x;
  const double dy_wb = from[1].y - from[0].y;
  const double per_wb = leakage_h / (dy_wb + leakage_h * dx_a);
  const double slope_h = per_wb * dy_wb;
  // The flux of the line through the segment at 0 A: zero on the first segment, where total_a may be zero.
  const double offset_wb = per_wb * (from[0].y * dx_a - from[0].x * dy_wb);
  return {.chord_h = offset_wb == 0.0 ? slope_h : slope_h + offset_wb / total_a, .slope_h = slope_h};
}

/// Magnetising flux linkage.
inline TwoPhase magnetising_flux_wb(const SaturatedInductionMachineConstants& c,
                                    const SaturatedInductionMachineState& x) noexcept {
  const double total_a_a = x.stator_a_wb * c.stator_leakage_per_h + x.rotor_a_wb * c.rotor_leakage_per_h;
  const double total_b_a = x.stator_b_wb * c.stator_leakage_per_h + x.rotor_b_wb * c.rotor_leakage_per_h;
  const double total_a = std::sqrt(total_a_a * total_a_a + total_b_a * total_b_a);
  const double chord_h = inductances(c.points, c.parallel_leakage_h, total_a).chord_h;
  return {.a = chord_h * total_a_a, .b = chord_h * total_b_a};
}

inline TwoPhase stator_current_a(const SaturatedInductionMachineConstants& c,
                                 const SaturatedInductionMachineState& x) noexcept {
  const TwoPhase flux_wb = magnetising_flux_wb(c, x);
  return {.a = (x.stator_a_wb - flux_wb.a) * c.stator_leakage_per_h,
          .b = (x.stator_b_wb - flux_wb.b) * c.stator_leakage_per_h};
}

/// The slope of the stator flux with part of the stator current or all of it blocked.
SaturatedInductionMachineState blocked(const SaturatedInductionMachineConstants& c,
                                       const SaturatedInductionMachineState& x,
                                       const SaturatedInductionMachineState& slope,
                                       const TerminalInput& u) noexcept;

}  // namespace saturation_detail

/// Stator frame, motor convention, rotation positive from phase a to phase b, J the quarter turn from a to b:
///   lambda_S' = u - R_S i_S,                  i_S = (lambda_S - lambda_m)/l_s
///   lambda_R' = -R_R i_R + n_p w J lambda_R,  i_R = (lambda_R - lambda_m)/l_r
/// with lambda_m along i_m = i_S + i_R and as long as the curve says, from which
///   i_m + lambda_m (1/l_s + 1/l_r) = lambda_S/l_s + lambda_R/l_r
/// Omitted: saturation of the leakages, iron losses, slotting. With a straight curve this is the
/// InductionMachine with L_S = l_s + M and L_R = l_r + M.
inline SaturatedInductionMachineState derivative(const SaturatedInductionMachineConstants& c,
                                                 const SaturatedInductionMachineState& x,
                                                 const RotorMotion& motion, const TerminalInput& u) noexcept {
  const double omega_e = c.pole_pairs * motion.speed_rad_s;
  const TwoPhase flux_wb = saturation_detail::magnetising_flux_wb(c, x);
  const double stator_per_s = c.stator_resistance_ohm * c.stator_leakage_per_h;
  const double rotor_per_s = c.rotor_resistance_ohm * c.rotor_leakage_per_h;
  const SaturatedInductionMachineState slope{
      .stator_a_wb = u.voltage_v.a - stator_per_s * (x.stator_a_wb - flux_wb.a),
      .stator_b_wb = u.voltage_v.b - stator_per_s * (x.stator_b_wb - flux_wb.b),
      .rotor_a_wb = -rotor_per_s * (x.rotor_a_wb - flux_wb.a) - omega_e * x.rotor_b_wb,
      .rotor_b_wb = -rotor_per_s * (x.rotor_b_wb - flux_wb.b) + omega_e * x.rotor_a_wb};
  return u.conduction == Conduction::kFull ? slope : saturation_detail::blocked(c, x, slope, u);
}

/// Torque on the rotor: n_p (lambda_m x i_S) = n_p (lambda_Sb lambda_ma - lambda_Sa lambda_mb)/l_s.
inline double torque_nm(const SaturatedInductionMachineConstants& c, const SaturatedInductionMachineState& x,
                        const RotorMotion&) noexcept {
  const TwoPhase flux_wb = saturation_detail::magnetising_flux_wb(c, x);
  return c.pole_pairs * c.stator_leakage_per_h * (x.stator_b_wb * flux_wb.a - x.stator_a_wb * flux_wb.b);
}

inline WindingValues winding_currents(const SaturatedInductionMachineConstants& c,
                                      const SaturatedInductionMachineState& x, const RotorMotion&) noexcept {
  return {.stator = saturation_detail::stator_current_a(c, x)};
}

/// The state with the part of the stator current removed that the circuit does not let flow; the rotor keeps
/// its flux.
SaturatedInductionMachineState restricted(const SaturatedInductionMachineConstants& c,
                                          const SaturatedInductionMachineState& x, const RotorMotion& motion,
                                          const TerminalInput& u) noexcept;

/// Voltages of the windings where no current flows and none changes.
WindingValues open_circuit_voltages(const SaturatedInductionMachineConstants& c,
                                    const SaturatedInductionMachineState& x,
                                    const RotorMotion& motion) noexcept;

/// Voltages of the windings with the currents that `u` lets flow: R_S i_S + lambda_S'. Saturation couples an
/// open phase with the others.
WindingValues winding_voltages(const SaturatedInductionMachineConstants& c,
                               const SaturatedInductionMachineState& x, const RotorMotion& motion,
                               const TerminalInput& u) noexcept;

/// The voltages of open windings while the others carry the currents that `u` lets flow.
inline WindingValues floating_voltages(const SaturatedInductionMachineConstants& c,
                                       const SaturatedInductionMachineState& x, const RotorMotion& motion,
                                       const TerminalInput& u) noexcept {
  return winding_voltages(c, x, motion, u);
}

/// Rotor flux linkage in the stator frame.
TwoPhase rotor_flux_wb(const SaturatedInductionMachineConstants& c, const SaturatedInductionMachineState& x,
                       const RotorMotion& motion) noexcept;

/// Magnetic energy: l_s |i_S|^2/2 + l_r |i_R|^2/2 + integral of i_m over lambda_m.
double stored_energy_j(const SaturatedInductionMachineConstants& c, const SaturatedInductionMachineState& x,
                       const RotorMotion& motion) noexcept;

/// Copper losses of stator and rotor: R_S |i_S|^2 + R_R |i_R|^2.
double losses_w(const SaturatedInductionMachineConstants& c, const SaturatedInductionMachineState& x,
                const RotorMotion& motion) noexcept;

Connection connection_of(const SaturatedInductionMachineParameters& p) noexcept;
/// Turns of the electrical angle for one of the shaft; 0 where the equations do not know the angle.
double pole_pairs_of(const SaturatedInductionMachineParameters& p) noexcept;
SaturatedInductionMachineParameters adjusted(const SaturatedInductionMachineParameters& p,
                                             const Adjustment& a) noexcept;
/// The fastest electrical time constant at any saturation: sets the substep.
double fastest_time_constant_s(const SaturatedInductionMachineParameters& p) noexcept;

/// Names the parts of the machine for the templates of plant/train/drive_train.hpp.
struct SaturatedInductionMachine {
  using Parameters = SaturatedInductionMachineParameters;
  using Constants = SaturatedInductionMachineConstants;
  using State = SaturatedInductionMachineState;
  static constexpr bool kUsesAngle = false;
  static constexpr bool kHasCorners = false;
  static MachineKind kind() noexcept;
};

}  // namespace drivebench
