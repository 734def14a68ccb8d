#pragma once

#include <complex>

#include "clients/control/math/frames.hpp"
#include "clients/models/induction_motor.hpp"

// Observers of the rotor flux of an induction machine beside the polar one of observers.hpp. In complex form,
// ψ = ψ_a + j·ψ_b in the stator frame, the flux obeys
//   dψ/dt = −(η − j·n_p·ω)·ψ + η·M·i
// All step from one sample to the next with currents, voltages and speed held over it.
namespace drivebench::control {

enum class FluxStep {
  kEuler,  ///< forward Euler: unstable above a speed, see euler_error_factor()
  kExact,  ///< the exponential: stable at any rate
};

/// An open-loop copy of the flux equation; its error decays at η whatever the speed. Source: Chiasson 2005,
/// (8.35) (IMO-01), exercises 19 and 22 (IMO-07).
class StationaryFluxObserver {
 public:
  StationaryFluxObserver(const InductionMachineModel& machine, double period_s, FluxStep kind) noexcept;

  PhasePair flux_wb() const noexcept { return {flux_wb_.real(), flux_wb_.imag()}; }
  void start_at(PhasePair flux_wb) noexcept { flux_wb_ = {flux_wb.a, flux_wb.b}; }
  void step(PhasePair current_a, double speed_rad_s) noexcept;

 private:
  InductionMachineModel machine_;
  double period_s_;
  FluxStep kind_;
  std::complex<double> flux_wb_;
};

/// By how much one Euler step multiplies the squared error: (1 − η·T)² + (n_p·ω·T)².
double euler_error_factor(const InductionMachineModel& machine, double speed_rad_s, double period_s) noexcept;
/// The sample rate that Euler needs more than: (η² + (n_p·ω)²)/(2η) [Hz].
double least_euler_rate_hz(const InductionMachineModel& machine, double speed_rad_s) noexcept;

/// The polar observer with the angle counted from the rotor: ρ = n_p·θ + s, which needs no speed:
///   dψ/dt = −η·ψ + η·M·i_d        ds/dt = η·M·i_q/ψ
/// Forward Euler; start and divisor as in PolarFluxObserver. Source: exercise 23 (IMO-08).
class PositionFluxObserver {
 public:
  PositionFluxObserver(const InductionMachineModel& machine, double period_s) noexcept;

  double magnitude_wb() const noexcept { return magnitude_wb_; }
  /// Of the flux from phase a, not wrapped, with the measured shaft angle of the same sample.
  double angle_rad(double shaft_angle_rad) const noexcept {
    return pole_pairs_ * shaft_angle_rad + slip_angle_rad_;
  }
  double slip_angle_rad() const noexcept { return slip_angle_rad_; }
  void step(DirectQuadrature current_a) noexcept;

 private:
  double decay_;  // η·T
  double gain_;   // η·M·T
  double pole_pairs_;
  double magnitude_wb_ = 1e-4;
  double slip_angle_rad_ = 0.0;
};

/// A flux observer faster than η, corrected by the derivative of the current, which a change of state makes
/// unnecessary to take:
///   z = (1 − k·M/L_R)·ψ̂ − k·σ·L_S·i        dz/dt = −(η − j·n_p·ω)·ψ̂ + η·M·i − k·(u − R_S·i)
/// The error decays at η/(1 − k·M/L_R): k = 0 is the copy, k ≤ 1 is safe, k > L_R/M diverges. Exact for held
/// inputs. Source: Verghese and Sanders, as in (8.44)-(8.53) (IMO-06).
class VergheseSandersObserver {
 public:
  /// `gain` is k, not L_R/M.
  VergheseSandersObserver(const InductionMotorModel& motor, double gain, double period_s) noexcept;

  /// With the current of the sample.
  PhasePair flux_wb(PhasePair current_a) const noexcept;
  void start_at(PhasePair flux_wb, PhasePair current_a) noexcept;
  void step(PhasePair current_a, PhasePair voltage_v, double speed_rad_s) noexcept;
  /// η/(1 − k·M/L_R) [1/s]
  double error_decay_per_s() const noexcept;

 private:
  std::complex<double> flux(std::complex<double> current_a) const noexcept;

  InductionMotorModel motor_;
  double gain_;
  double share_;  // 1 − k·M/L_R
  double period_s_;
  std::complex<double> z_wb_;
};

/// Observes the stator flux λ = L_S·i + M·i_R and the current, with all gains turning with the rotor; with
/// s = R_R − j·n_p·ω·L_R and a = 1/(σ·L_R·L_S):
///   dλ̂/dt = u − R_S·i + s·c1·(i − î)
///   dî/dt = s·a·(λ̂ + c2·(i − î)) − (s/L_R + γ)·i + u/(σ·L_S)        ψ̂ = (L_R·λ̂ − σ·L_R·L_S·i)/M
/// so the error is ε(t) = exp((R_R·t − j·n_p·θ(t)·L_R)·A)·ε(0) for any motion, A having the eigenvalues −r1,
/// −r2: c2·a = r1 + r2 and c1·a = r1·r2. Real rates make it decay as exp(−R_R·r·t) whatever the speed. Exact
/// for held inputs. Source: Martin and Rouchon, exercise 27 (IMO-11); the prints of c1, c2 and of the sign of
/// dî/dt do not fit the error system, these do.
class MartinRouchonObserver {
 public:
  /// Rates r1 ≠ r2, both positive [1/H]; the error decays at R_R·r1 and R_R·r2.
  MartinRouchonObserver(const InductionMotorModel& motor, double r1, double r2, double period_s) noexcept;

  PhasePair stator_flux_wb() const noexcept { return {stator_flux_wb_.real(), stator_flux_wb_.imag()}; }
  PhasePair current_a() const noexcept { return {current_a_.real(), current_a_.imag()}; }
  /// Of the rotor, with the measured current of the sample.
  PhasePair flux_wb(PhasePair current_a) const noexcept;
  void start_at(PhasePair stator_flux_wb, PhasePair current_a) noexcept;
  void step(PhasePair current_a, PhasePair voltage_v, double speed_rad_s) noexcept;
  double flux_gain() const noexcept { return flux_gain_; }            ///< c1, a pure number
  double current_gain_h() const noexcept { return current_gain_h_; }  ///< c2

 private:
  InductionMotorModel motor_;
  double r1_;
  double r2_;
  double period_s_;
  double stiffness_;  // a
  double flux_gain_;
  double current_gain_h_;
  std::complex<double> stator_flux_wb_;
  std::complex<double> current_a_;
};

}  // namespace drivebench::control
