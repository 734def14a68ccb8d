#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <tuple>
#include <vector>

#include "clients/control/gains/gains.hpp"
#include "clients/control/induction/optimum_torque_induction.hpp"
#include "clients/control/moves/trajectory.hpp"

namespace drivebench::control {

enum class FluxPolicy {
  kConstant,        ///< ψ_d0
  kFieldWeakening,  ///< ψ_d0 up to the base speed, ψ_d0·ω_base/|ω| above it
  kOptimumTorque,   ///< the flux of a share of the optimum torque at this speed
};

/// The flux that a machine is to have. Source: the book, (8.24) (IMC-04) and 8.4 (IMX-02).
struct FluxReferenceParameters {
  double rated_flux_wb;           ///< ψ_d0; with the optimum torque it has no effect
  double base_speed_rad_s;        ///< of field weakening
  double motoring_share = 1.0;    ///< of the optimum torque: i_d,ref = √share·i_d,opt(ω)
  double generating_share = 1.0;  ///< while α_ref brakes
  double feed_forward = 1.0;      ///< share of i_d,ref that is passed on; 0 leaves all of it to the flux loop
  FluxPolicy policy = FluxPolicy::kConstant;

  static constexpr std::tuple kGains{
      gain("flux_reference.rated_flux_wb", &FluxReferenceParameters::rated_flux_wb, GainRule::kPositive),
      gain("flux_reference.base_speed_rad_s", &FluxReferenceParameters::base_speed_rad_s,
           GainRule::kPositive),
      gain("flux_reference.feed_forward", &FluxReferenceParameters::feed_forward, GainRule::kNotNegative)};
  std::vector<std::string> problems() const { return range_problems(*this); }
};

struct FluxTarget {
  double flux_wb;
  double rate_wb_s;          ///< dψ_ref/dt
  double second_rate_wb_s2;  ///< d²ψ_ref/dt², between the steps of i_d,ref
  double i_d_a;              ///< feed-forward
};

/// The flux reference over the samples. That of the optimum torque follows its current as the machine does:
///   dψ_ref/dt = −η·ψ_ref + η·M·i_d,ref
/// exactly over a period, so that ψ_ref can be reached; it starts where the first current leads to.
class FluxReference {
 public:
  /// `optimum` is needed for FluxPolicy::kOptimumTorque alone.
  FluxReference(const FluxReferenceParameters& p, const InductionMachineModel& machine, double period_s,
                std::shared_ptr<const OptimumTorqueTable> optimum = nullptr) noexcept;

  /// For this sample; the first call is the start.
  FluxTarget step(const Reference& r, std::int64_t periods = 1) noexcept;

 private:
  FluxTarget algebraic(const Reference& r) const noexcept;
  FluxTarget optimum(const Reference& r, std::int64_t periods) noexcept;

  FluxReferenceParameters p_;
  InductionMachineModel machine_;
  double period_s_;
  std::shared_ptr<const OptimumTorqueTable> optimum_;
  bool started_ = false;
  double flux_wb_ = 0.0;
  double last_i_d_a_ = 0.0;
};

}  // namespace drivebench::control
