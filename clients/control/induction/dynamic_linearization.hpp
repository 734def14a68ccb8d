#pragma once

#include <memory>
#include <string>
#include <tuple>
#include <vector>

#include "clients/control/induction/field_oriented_controller.hpp"
#include "clients/control/induction/flux_reference.hpp"
#include "clients/control/induction/induction_drive.hpp"

namespace drivebench::control {

struct DirectIntegratorParameters {
  double current_pole_per_s;
  ServoGains position;
  double flux_proportional_per_s2;  ///< G1
  double flux_derivative_per_s;     ///< G2
  double least_distance;            ///< to the singularity, of 1

  static constexpr std::tuple kGains{
      gain("current.pole_per_s", &DirectIntegratorParameters::current_pole_per_s, GainRule::kPositive),
      gains_in("position.", &DirectIntegratorParameters::position),
      gain("flux.proportional_per_s2", &DirectIntegratorParameters::flux_proportional_per_s2,
           GainRule::kNotNegative),
      gain("flux.derivative_per_s", &DirectIntegratorParameters::flux_derivative_per_s,
           GainRule::kNotNegative),
      gain("least_distance", &DirectIntegratorParameters::least_distance, GainRule::kPositive)};
  std::vector<std::string> problems() const { return range_problems(*this); }
};

/// The factor c between the speed and the rate of the second linearised output, and its own rate:
///   c = n_p + g·(f/J + 2ψ'/ψ)     with g = η·M/(μ·ψ²), so g' = −2g·ψ'/ψ
struct SpeedFactor {
  double c;
  double c_per_s;

  static SpeedFactor at(const InductionMachineModel& m, double flux_wb, double rate_wb_s,
                        double second_rate_wb_s2) noexcept;
};

/// Position control of an induction machine by dynamic feedback linearisation with an integrator on the d
/// axis. Speed, flux, flux angle and i_d are linear in ψ and
///   y = ρ − g·ω        y' = c·ω
/// through ψ'' = v_ψ with di_d/dt = (v_ψ + η·ψ')/(η·M), and y'' = v_y with i_q = ((v_y − ω·c')/c +
/// (f/J)·ω)/(μ·ψ):
///   v_ψ = ψ_ref'' + G2·(ψ_ref' − ψ') + G1·(ψ_ref − ψ)
///   v_y = y_ref'' + K2·(y_ref' − y') + n_p·(K1·e + K0·∫e)        e = θ_ref − θ,  y_ref' = c·ω_ref
/// The angle loop is ours, and so is y_ref with the c of the machine: with that of ψ_ref an error of the flux
/// would be one of the speed. Singular at c = 0: without friction ψ' = −n_p²·ψ³/(2·J·R_R), −0.988 Wb/s for
/// the servo motor at rated flux, −0.052 Wb/s at 0.017 Wb. While c/n_p is below least_distance, c of constant
/// flux stands in, which is input-output linearisation, and `singular` in the telemetry is 1. Current loops
/// that decouple follow. Source: the book, exercise 28 of chapter 8 (IMC-07), derived here.
class DirectIntegratorController final : public Controller {
 public:
  /// No parameter set may have problems(). `optimum` as in FluxReference.
  DirectIntegratorController(const InductionDriveParameters& drive, const DirectIntegratorParameters& p,
                             const FluxReferenceParameters& flux,
                             std::shared_ptr<const OptimumTorqueTable> optimum = nullptr) noexcept;

 private:
  Setpoint step(const Measurement& m, const Reference& r, std::int64_t periods) noexcept override;

  InductionDriveParameters drive_;
  DirectIntegratorParameters p_;
  InductionFeedback feedback_;
  FluxReference flux_reference_;
  DecoupledCurrentLoop current_loop_;
  double i_d_ref_a_ = 0.0;  // the integrator
  double angle_integral_rad_s_ = 0.0;
};

/// Gains of the angle loop (s + r)³ and of the slip loop s + g; see below.
struct QuadratureIntegratorParameters {
  double current_pole_per_s;
  double angle_pole_per_s;  ///< r
  double slip_pole_per_s;   ///< g
  double load_pole_per_s;   ///< three of the load observer
  double least_i_q_a;       ///< below it the law is too close to its singularity

  static constexpr std::tuple kGains{
      gain("current.pole_per_s", &QuadratureIntegratorParameters::current_pole_per_s, GainRule::kPositive),
      gain("angle.pole_per_s", &QuadratureIntegratorParameters::angle_pole_per_s, GainRule::kPositive),
      gain("slip.pole_per_s", &QuadratureIntegratorParameters::slip_pole_per_s, GainRule::kPositive),
      gain("load_observer.pole_per_s", &QuadratureIntegratorParameters::load_pole_per_s, GainRule::kPositive),
      gain("least_i_q_a", &QuadratureIntegratorParameters::least_i_q_a, GainRule::kPositive)};
  std::vector<std::string> problems() const { return range_problems(*this); }
};

/// The demand of the law on the currents: a value for one, a rate for the other.
struct QuadratureIntegratorCommand {
  double i_d_a;
  double i_q_rate_a_s;
};

/// The motor's acceleration α = μ·ψ·i_q and the slip S = η·M·i_q/ψ obey
///   α' = −η·α + μ·η·M·i_q·i_d + μ·ψ·di_q/dt        S' = η·S − (η²·M²·i_q/ψ²)·i_d + (η·M/ψ)·di_q/dt
/// so that α' = w_α and S' = w_S are had by, with b_α = w_α + η·α and b_S = w_S − η·S,
///   di_q/dt = b_α/(2·μ·ψ) + ψ·b_S/(2·η·M)        i_d = b_α/(2·μ·η·M·i_q) − ψ²·b_S/(2·η²·M²·i_q)
/// The determinant 2·η²·M²·μ·i_q/ψ vanishes at i_q = 0.
QuadratureIntegratorCommand quadrature_integrator(const InductionMachineModel& m, const InductionState& x,
                                                  double alpha_rate_rad_s3, double slip_rate_rad_s2) noexcept;

/// Position control of an induction machine by dynamic feedback linearisation with an integrator on the q
/// axis: shaft angle and flux angle are linear, and the flux is what the slip makes of the torque. With e =
/// θ_ref − θ, α_ref,m = α_ref + (f/J)·ω_ref + τ̂_L/J and S_ref = η·M·α_ref,m/(μ·ψ_ref²),
///   w_α = α_ref,m' + 3r·(α_ref,m − α) + 3r²·(ω_ref − ω̂) + r³·e        w_S = S_ref' + g·(S_ref − S)
/// Of the flux angle the rate alone is controlled: torque does not depend on the angle. τ̂_L is that of the
/// load observer (IMO-09), which takes the place of an integral. Singular at i_q = 0: the machine must hold a
/// load. While |i_q| is below least_i_q_a input-output linearisation stands in and `singular` in the
/// telemetry is 1. Current loops that decouple follow. Source: the book, exercises 29 and 30 of chapter
/// 8 (IMC-08).
class QuadratureIntegratorController final : public Controller {
 public:
  /// No parameter set may have problems().
  QuadratureIntegratorController(const InductionDriveParameters& drive,
                                 const QuadratureIntegratorParameters& p,
                                 const FluxReferenceParameters& flux) noexcept;

 private:
  Setpoint step(const Measurement& m, const Reference& r, std::int64_t periods) noexcept override;

  InductionDriveParameters drive_;
  QuadratureIntegratorParameters p_;
  LoadedInductionFeedback feedback_;
  FluxReference flux_reference_;
  DecoupledCurrentLoop current_loop_;
  Dq reference_a_{.d = 0.0, .q = 0.0};
};

struct FlatInductionParameters {
  double current_pole_per_s;
  double slip_rad_s;       ///< S, the rate of the flat output beside the angle
  ServoGains position;     ///< around the flat trajectory
  double load_pole_per_s;  ///< three of the load observer
  double least_torque_nm;  ///< of the motor; below it the law is too close to its singularity

  static constexpr std::tuple kGains{
      gain("current.pole_per_s", &FlatInductionParameters::current_pole_per_s, GainRule::kPositive),
      gain("slip_rad_s", &FlatInductionParameters::slip_rad_s, GainRule::kPositive),
      gains_in("position.", &FlatInductionParameters::position),
      gain("load_observer.pole_per_s", &FlatInductionParameters::load_pole_per_s, GainRule::kPositive),
      gain("least_torque_nm", &FlatInductionParameters::least_torque_nm, GainRule::kPositive)};
  std::vector<std::string> problems() const { return range_problems(*this); }
};

/// State and currents of a machine from its flat outputs: the angle of the shaft and ρ_R = ρ − n_p·θ, the
/// angle of the flux from the rotor. With τ the motor's torque, τ = (n_p/R_R)·ψ²·ρ_R', and a constant rate S
/// of ρ_R:
///   ψ = √(R_R·τ/(n_p·S))        ψ' = ψ·τ'/(2τ)        i_d = (ψ + ψ'/η)/M        i_q = ψ·S/(η·M)
/// Singular at zero torque. With S = η the steady currents are alike, the shortest for the torque.
struct FlatInductionState {
  double flux_wb;
  double flux_rate_wb_s;
  Dq current_a;
  double i_q_rate_a_s;
};
FlatInductionState flat_induction(const InductionMachineModel& m, double slip_rad_s, double torque_nm,
                                  double torque_rate_nm_s) noexcept;

/// Position control of an induction machine along its flat outputs: currents and their rates follow from
/// θ_ref and from a constant slip, feedback of the angle is added to i_q,
///   i_q,ref = (τ*/J + K0·∫e + K1·e + K2·(ω_ref − ω̂))/(μ·ψ̂)        τ* = J·α_ref + f·ω_ref + τ̂_L
/// and the flux finds to its trajectory by itself, at η. τ̂_L is that of the load observer (IMO-09): the
/// machine must hold a load. While τ* is below least_torque_nm the flux of that torque stands in, and
/// `singular` in the telemetry is 1. Current loops that decouple follow. Source: the book, exercise 30 of
/// chapter 8.
class FlatInductionController final : public Controller {
 public:
  /// No parameter set may have problems().
  FlatInductionController(const InductionDriveParameters& drive, const FlatInductionParameters& p) noexcept;

 private:
  Setpoint step(const Measurement& m, const Reference& r, std::int64_t periods) noexcept override;

  InductionDriveParameters drive_;
  FlatInductionParameters p_;
  LoadedInductionFeedback feedback_;
  DecoupledCurrentLoop current_loop_;
  double angle_integral_rad_s_ = 0.0;
};

}  // namespace drivebench::control
