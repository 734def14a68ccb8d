#pragma once

#include <complex>

#include "clients/control/estimators/load_observers.hpp"
#include "clients/models/induction_machine.hpp"
#include "plant/math/frames.hpp"

// Observers of the rotor flux of an induction machine beside the polar one. In complex form, ψ = ψ_a + j·ψ_b
// in the stator frame, the flux obeys
//   dψ/dt = −(η − j·n_p·ω)·ψ + η·M·i
// All step from one sample to the next with currents, voltages and speed held over it.
namespace drivebench::control {

enum class FluxStep {
  kEuler,  ///< forward Euler: unstable above a speed, see euler_error_factor()
  kExact,  ///< the exponential: stable at any rate
};

/// An open-loop copy of the flux equation; its error decays at η whatever the speed. Source: the book,
/// (8.35) (IMO-01), exercises 19 and 22 (IMO-07).
class StationaryFluxObserver {
 public:
  StationaryFluxObserver(const InductionMachineModel& machine, double period_s, FluxStep kind) noexcept;

  TwoPhase flux_wb() const noexcept { return {flux_wb_.real(), flux_wb_.imag()}; }
  void start_at(TwoPhase flux_wb) noexcept { flux_wb_ = {flux_wb.a, flux_wb.b}; }
  void step(TwoPhase current_a, double speed_rad_s) noexcept;

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
  TwoPhase flux_wb(TwoPhase current_a) const noexcept;
  void start_at(TwoPhase flux_wb, TwoPhase current_a) noexcept;
  void step(TwoPhase current_a, TwoPhase voltage_v, double speed_rad_s) noexcept;
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

  TwoPhase stator_flux_wb() const noexcept { return {stator_flux_wb_.real(), stator_flux_wb_.imag()}; }
  TwoPhase current_a() const noexcept { return {current_a_.real(), current_a_.imag()}; }
  /// Of the rotor, with the measured current of the sample.
  TwoPhase flux_wb(TwoPhase current_a) const noexcept;
  void start_at(TwoPhase stator_flux_wb, TwoPhase current_a) noexcept;
  void step(TwoPhase current_a, TwoPhase voltage_v, double speed_rad_s) noexcept;
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

/// Flux in rotor coordinates, which turn with n_p·θ and so need no speed, then speed and load from it:
///   dψ_r/dt = −η·ψ_r + η·M·i_r        α_motor = μ·(ψ_x·i_y − ψ_y·i_x)
/// The flux error decays at η and does not depend on speed or load; the flux is exact for a held i_r. Source:
/// exercise 26 (IMO-10).
class RotorFrameObserver {
 public:
  RotorFrameObserver(const InductionMachineModel& machine, const LoadObserverGains& gains,
                     double period_s) noexcept;

  /// In the stator frame, with the measured shaft angle of the same sample.
  TwoPhase flux_wb(double shaft_angle_rad) const noexcept;
  TwoPhase rotor_frame_flux_wb() const noexcept { return flux_wb_; }
  double speed_rad_s() const noexcept { return motion_.speed_rad_s(); }
  double load_nm() const noexcept { return motion_.load_nm(); }
  void start_at(TwoPhase rotor_frame_flux_wb) noexcept { flux_wb_ = rotor_frame_flux_wb; }
  void step(TwoPhase current_a, double shaft_angle_rad) noexcept;

 private:
  InductionMachineModel machine_;
  double kept_;  // exp(−η·T)
  TwoPhase flux_wb_{.a = 0.0, .b = 0.0};
  LoadTorqueObserver motion_;
};

}  // namespace drivebench::control
