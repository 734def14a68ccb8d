#pragma once

#include <array>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "clients/control/induction/decoupled_current_loop.hpp"
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

  static std::span<const GainRow<DirectIntegratorParameters>> gains() noexcept;
  std::vector<std::string> problems() const;
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
/// that decouple follow. Source: Chiasson 2005, exercise 28 of chapter 8 (IMC-07), derived here.
class DirectIntegratorController final : public Controller {
 public:
  /// No parameter set may have problems(). `optimum` as in FluxReference.
  DirectIntegratorController(const InductionDriveParameters& drive, const DirectIntegratorParameters& p,
                             const FluxReferenceParameters& flux,
                             std::shared_ptr<const OptimumTorqueTable> optimum = nullptr) noexcept;

  Setpoint update(const Measurement& m, const Reference& r, std::int64_t periods = 1) noexcept override;

  Quantity quantity() const noexcept override { return Quantity::kVoltage; }
  double angle_rad() const noexcept override { return feedback_.state().angle_rad; }
  double speed_rad_s() const noexcept override { return feedback_.state().speed_rad_s; }
  bool saturated() const noexcept override { return saturated_; }
  std::span<const std::string_view> telemetry_names() const noexcept override;
  std::span<const double> telemetry() const noexcept override { return telemetry_; }

 private:
  InductionDriveParameters drive_;
  DirectIntegratorParameters p_;
  InductionFeedback feedback_;
  FluxReference flux_reference_;
  DecoupledCurrentLoop current_loop_;
  double i_d_ref_a_ = 0.0;  // the integrator
  double angle_integral_rad_s_ = 0.0;
  bool saturated_ = false;
  std::array<double, 8> telemetry_{};
};

}  // namespace drivebench::control
