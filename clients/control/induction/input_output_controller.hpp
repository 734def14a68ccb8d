#pragma once

#include <array>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "clients/control/induction/field_oriented_controller.hpp"
#include "clients/control/induction/flux_reference.hpp"
#include "clients/control/induction/induction_drive.hpp"
#include "clients/control/loop/current_loop.hpp"

namespace drivebench::control {

/// By which flux the wanted acceleration is divided.
enum class TorqueDivisor {
  kEstimatedFlux,  ///< input-output linearisation: right while the flux changes
  kFluxReference,  ///< field-oriented control: right once the flux is where it should be
};

struct InputOutputParameters {
  CurrentLoopGains current;
  ServoGains position;
  FluxGains flux;
  TorqueDivisor divisor = TorqueDivisor::kEstimatedFlux;

  static std::span<const GainRow<InputOutputParameters>> gains() noexcept;
  std::vector<std::string> problems() const;
};

/// Position control of an induction machine whose flux is being moved, with current command:
///   i_d,ref = K_ψP·(ψ_ref − ψ̂) + K_ψI·∫(ψ_ref − ψ̂) + i_d,ff
///   i_q,ref = (K0·∫e + K1·e + K2·(ω_ref − ω̂) + α_ref + (f/J)·ω̂)/(μ·ψ̂)        e = θ_ref − θ
/// so that flux and speed are linear and do not see each other; with TorqueDivisor::kFluxReference it is
/// field-oriented control, with field weakening if the flux reference has it. Followed by PI current loops. A
/// reference at its clip freezes its own integrator, a phase at its voltage limit all of them. Source:
/// Chiasson 2005, (8.24), (8.27)-(8.32) (IMC-04, IMC-05).
class InputOutputController final : public Controller {
 public:
  /// No parameter set may have problems(). `optimum` as in FluxReference.
  InputOutputController(const InductionDriveParameters& drive, const InputOutputParameters& p,
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
  InputOutputParameters p_;
  InductionFeedback feedback_;
  FluxReference flux_reference_;
  CurrentLoop current_loop_;
  double angle_integral_rad_s_ = 0.0;
  double flux_integral_wb_s_ = 0.0;
  bool saturated_ = false;
  std::array<double, 8> telemetry_{};
};

}  // namespace drivebench::control
