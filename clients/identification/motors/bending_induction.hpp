#pragma once

#include <cmath>
#include <complex>

#include "clients/identification/motors/motor_models.hpp"
#include "plant/math/exponential.hpp"
#include "plant/math/phasor.hpp"

namespace drivebench::identification {

/// InductionModel with a magnetising curve that bends a little: beside i_S + i_R = λ_m/M the iron takes
///   δ = b (|λ_m|/λ_ref)^n λ_m/M,    b: the part at the flux λ_ref, beyond which δ stays
/// λ_m is that of two equal leakages l = L_S − M, to first order in b: λ_m = φ + (σ L_S − l) i, where the
/// state i = i_S − κ/(1 + κ) δ with κ = M/L_R keeps λ_S = σ L_S i + φ:
///   σ L_S i' = u − R_S i_S − φ',   φ' = −(φ − (1 − σ) L_S (i_S − δ))/T_R + j n_p ω φ
struct BendingInductionModel : InductionModel {
  double bend = 0.0;          ///< b
  double power = 2.0;         ///< n
  double reference_wb = 1.0;  ///< λ_ref
  double resistance_ohm, mutual_h, leakage_h, share;

  BendingInductionModel(const Result& r, const Settings& e)
      : InductionModel(r, e), resistance_ohm(r.at("R_S")) {
    const double coupling = std::sqrt(1.0 - r.at("sigma"));
    mutual_h = coupling * r.at("L_S");
    leakage_h = r.at("L_S") - mutual_h;
    share = coupling / (1.0 + coupling);
  }

  std::complex<double> magnetising_flux_wb(const State& x) const noexcept {
    return std::complex(x[2], x[3]) + (transient_h - leakage_h) * std::complex(x[0], x[1]);
  }
  State slope(const State& x, const MotorInput& in) const noexcept {
    const std::complex<double> added = added_current_a(x);
    const std::complex<double> linear(x[0], x[1]);
    const std::complex<double> current = linear + share * added;
    const std::complex<double> phi(x[2], x[3]);
    const std::complex<double> phi_slope =
        rotor_rate * (magnetising_h * (current - added) - phi) + std::complex(0.0, pole_pairs * x[4]) * phi;
    const std::complex<double> u = two_phase_of(in.u, three_phase);
    const std::complex<double> slope = (u - resistance_ohm * current - phi_slope) * per_transient_h;
    const double torque = pole_pairs * std::imag(std::conj(transient_h * linear + phi) * current);
    return {slope.real(), slope.imag(), phi_slope.real(), phi_slope.imag(),
            (torque - friction * x[4] - load) * per_inertia};
  }
  std::array<double, 3> currents(const State& x, const MotorInput&) const noexcept {
    return phases_of(std::complex(x[0], x[1]) + share * added_current_a(x), three_phase);
  }

 private:
  std::complex<double> added_current_a(const State& x) const noexcept {
    const std::complex<double> flux = magnetising_flux_wb(x);
    const double part = magnitude(flux) / reference_wb;
    return flux * (bend * (part < 1.0 ? drivebench::power(part, power) : 1.0 / part) / mutual_h);
  }
};

}  // namespace drivebench::identification
