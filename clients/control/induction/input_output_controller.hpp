#pragma once

#include <memory>
#include <string>
#include <tuple>
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
  CurrentGains current;
  ServoGains position;
  FluxGains flux;
  TorqueDivisor divisor = TorqueDivisor::kEstimatedFlux;

  static constexpr std::tuple kGains{gains_in("current.", &InputOutputParameters::current),
                                     gains_in("position.", &InputOutputParameters::position),
                                     gains_in("flux.", &InputOutputParameters::flux)};
  std::vector<std::string> problems() const { return range_problems(*this); }
};

/// Position control of an induction machine whose flux is being moved, with current command:
///   i_d,ref = K_ψP·(ψ_ref − ψ̂) + K_ψI·∫(ψ_ref − ψ̂) + i_d,ff
///   i_q,ref = (K0·∫e + K1·e + K2·(ω_ref − ω̂) + α_ref + (f/J)·ω̂)/(μ·ψ̂)        e = θ_ref − θ
/// so that flux and speed are linear and do not see each other; with TorqueDivisor::kFluxReference it is
/// field-oriented control, with field weakening if the flux reference has it. Followed by PI current loops. A
/// reference at its clip freezes its own integrator, a phase at its voltage limit all of them. Source:
/// the book, (8.24), (8.27)-(8.32) (IMC-04, IMC-05).
class InputOutputController final : public Controller {
 public:
  /// No parameter set may have problems(). `optimum` as in FluxReference.
  InputOutputController(const InductionDriveParameters& drive, const InputOutputParameters& p,
                        const FluxReferenceParameters& flux,
                        std::shared_ptr<const OptimumTorqueTable> optimum = nullptr) noexcept;

 private:
  Setpoint step(const Measurement& m, const Reference& r, std::int64_t periods) noexcept override;

  InductionDriveParameters drive_;
  InputOutputParameters p_;
  InductionFeedback feedback_;
  FluxReference flux_reference_;
  CurrentLoop current_loop_;
  double angle_integral_rad_s_ = 0.0;
  double flux_integral_wb_s_ = 0.0;
};

}  // namespace drivebench::control
