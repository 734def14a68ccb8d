#pragma once

#include <array>
#include <cmath>
#include <complex>
#include <cstddef>

#include "clients/identification/data/magnetising_curve.hpp"
#include "clients/identification/motors/motor_models.hpp"

namespace drivebench::identification {

/// Induction motor whose magnetising flux saturates; its leakages do not. In the stator's frame:
///   l_s i_S' + λ_m' = u − R_S i_S,   λ_R' = −R_R i_R + j n_p ω λ_R,   λ_R = l_r i_R + λ_m
///   i_S + i_R = ρ(|λ_m|²) λ_m,   J ω' = n_p Im(λ_m* i_S) − {f ω or τ_L}
/// The first three give (l_r P + l_r/l_s + 1) λ_m' = λ_R' + (l_r/l_s) (u − R_S i_S), where P = ρ + 2 ρ' λ_m
/// λ_m^T is the change of the magnetising current with the flux, so that a slope needs no search on the
/// curve.
struct SaturatedInductionModel {
  using State = std::array<double, 5>;  // i_alpha, i_beta, lambda_alpha, lambda_beta, w
  static constexpr std::size_t kSpeed = 4;
  static constexpr bool kTurns = false;
  SaturatedCircuit circuit;
  MagnetisingCurve curve;
  double resistance_ohm, friction = 0.0, load = 0.0, pole_pairs;
  double ratio, per_stator_leakage_h, per_inertia;
  bool three_phase;

  SaturatedInductionModel(const Result& r, const Settings& e)
      : circuit(saturated_circuit(r)),
        curve(magnetising_curve(r)),
        resistance_ohm(r.at("R_S")),
        pole_pairs(e.pole_pairs),
        ratio(circuit.rotor_leakage_h / circuit.stator_leakage_h),
        per_stator_leakage_h(1.0 / circuit.stator_leakage_h),
        per_inertia(1.0 / r.at("J")),
        three_phase(e.three_phase) {
    if (const Estimate* f = r.find("f")) friction = f->value;
    if (const Estimate* tau = r.find("tau_L")) load = tau->value;
  }
  double leakage_h() const noexcept { return circuit.stator_leakage_h + circuit.rotor_leakage_h; }
  double fastest_rate(double speed) const noexcept {
    return (resistance_ohm + circuit.rotor_resistance_ohm) / leakage_h() + pole_pairs * std::abs(speed);
  }
  State slope(const State& x, const MotorInput& in) const noexcept {
    const std::complex<double> u = two_phase_of(in.u, three_phase);
    const double flux2 = x[2] * x[2] + x[3] * x[3];
    const MagnetisingCurve::Reluctance rho = curve.at(flux2);
    const double rotor_a = rho.chord * x[2] - x[0];
    const double rotor_b = rho.chord * x[3] - x[1];
    const double omega_e = pole_pairs * x[4];
    const double left_a = u.real() - resistance_ohm * x[0];
    const double left_b = u.imag() - resistance_ohm * x[1];
    const double whole_a = ratio * left_a - circuit.rotor_resistance_ohm * rotor_a -
                           omega_e * (circuit.rotor_leakage_h * rotor_b + x[3]);
    const double whole_b = ratio * left_b - circuit.rotor_resistance_ohm * rotor_b +
                           omega_e * (circuit.rotor_leakage_h * rotor_a + x[2]);
    // The matrix is a number and a dyad of the flux: its inverse is one as well.
    const double across = 1.0 / (circuit.rotor_leakage_h * rho.chord + ratio + 1.0);
    const double bent = 2.0 * circuit.rotor_leakage_h * rho.slope * across;
    const double along = bent * (x[2] * whole_a + x[3] * whole_b) / (1.0 + bent * flux2);
    const double flux_a = across * (whole_a - along * x[2]);
    const double flux_b = across * (whole_b - along * x[3]);
    const double torque = pole_pairs * (x[2] * x[1] - x[3] * x[0]);
    return {(left_a - flux_a) * per_stator_leakage_h, (left_b - flux_b) * per_stator_leakage_h, flux_a,
            flux_b, (torque - friction * x[4] - load) * per_inertia};
  }
  void settle(State&, const State&, double) const noexcept {}
  std::array<double, 3> currents(const State& x, const MotorInput&) const noexcept {
    return phases_of({x[0], x[1]}, three_phase);
  }
  /// The state without flux of the rotor: that of a start until it has seen some of its time constant.
  State state_of(const std::array<double, 3>& i, double speed, const MotorInput&) const noexcept {
    const std::complex<double> current = two_phase_of(i, three_phase);
    const std::complex<double> flux = circuit.rotor_leakage_h * current;
    return {current.real(), current.imag(), flux.real(), flux.imag(), speed};
  }
  /// The largest current is that of a start, whose voltage lies across the leakages: their flux is that of
  /// the gap.
  State spread(double current_a, double speed_rad_s) const noexcept {
    const double flux = leakage_h() * current_a / kKnownPart;
    return {current_a, current_a, flux, flux, speed_rad_s};
  }
};

}  // namespace drivebench::identification
