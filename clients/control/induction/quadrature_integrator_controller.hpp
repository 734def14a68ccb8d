#pragma once

#include <array>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "clients/control/induction/decoupled_current_loop.hpp"
#include "clients/control/induction/flux_reference.hpp"
#include "clients/control/induction/induction_drive.hpp"

namespace drivebench::control {

/// Gains of the angle loop (s + r)³ and of the slip loop s + g; see below.
struct QuadratureIntegratorParameters {
  double current_pole_per_s;
  double angle_pole_per_s;  ///< r
  double slip_pole_per_s;   ///< g
  double load_pole_per_s;   ///< three of the load observer
  double least_i_q_a;       ///< below it the law is too close to its singularity

  static std::span<const GainRow<QuadratureIntegratorParameters>> gains() noexcept;
  std::vector<std::string> problems() const;
};

/// What the law asks of the currents: a value for one, a rate for the other.
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
/// The flux angle is controlled in its rate alone: nobody needs where the flux stands. τ̂_L is that of the
/// load observer (IMO-09), which takes the place of an integral. Singular at i_q = 0: the machine must hold a
/// load. While |i_q| is below least_i_q_a input-output linearisation stands in and `singular` in the
/// telemetry is 1. Current loops that decouple follow. Source: Chiasson 2005, exercises 29 and 30 of chapter
/// 8 (IMC-08).
class QuadratureIntegratorController final : public Controller {
 public:
  /// No parameter set may have problems().
  QuadratureIntegratorController(const InductionDriveParameters& drive,
                                 const QuadratureIntegratorParameters& p,
                                 const FluxReferenceParameters& flux) noexcept;

  Setpoint update(const Measurement& m, const Reference& r, std::int64_t periods = 1) noexcept override;

  Quantity quantity() const noexcept override { return Quantity::kVoltage; }
  double angle_rad() const noexcept override { return feedback_.state().angle_rad; }
  double speed_rad_s() const noexcept override { return feedback_.state().speed_rad_s; }
  bool saturated() const noexcept override { return saturated_; }
  std::span<const std::string_view> telemetry_names() const noexcept override;
  std::span<const double> telemetry() const noexcept override { return telemetry_; }

 private:
  InductionDriveParameters drive_;
  QuadratureIntegratorParameters p_;
  LoadedInductionFeedback feedback_;
  FluxReference flux_reference_;
  DecoupledCurrentLoop current_loop_;
  DirectQuadrature reference_a_{.d = 0.0, .q = 0.0};
  bool saturated_ = false;
  std::array<double, 8> telemetry_{};
};

}  // namespace drivebench::control
