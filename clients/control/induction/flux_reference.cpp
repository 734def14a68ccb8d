#include "clients/control/induction/flux_reference.hpp"

#include <cmath>
#include <utility>

#include "plant/math/exponential.hpp"

namespace drivebench::control {

FluxReference::FluxReference(const FluxReferenceParameters& p, const InductionMachineModel& machine,
                             double period_s, std::shared_ptr<const OptimumTorqueTable> optimum) noexcept
    : p_(p), machine_(machine), period_s_(period_s), optimum_(std::move(optimum)) {}

FluxTarget FluxReference::step(const Reference& r, std::int64_t periods) noexcept {
  const bool by_table = p_.policy == FluxPolicy::kOptimumTorque && optimum_ != nullptr;
  FluxTarget target = by_table ? optimum(r, periods) : algebraic(r);
  target.i_d_a *= p_.feed_forward;
  return target;
}

FluxTarget FluxReference::algebraic(const Reference& r) const noexcept {
  const double speed_rad_s = std::abs(r.speed_rad_s);
  FluxTarget target = {.flux_wb = p_.rated_flux_wb, .rate_wb_s = 0.0, .second_rate_wb_s2 = 0.0, .i_d_a = 0.0};
  if (p_.policy == FluxPolicy::kFieldWeakening && speed_rad_s > p_.base_speed_rad_s) {
    target.flux_wb *= p_.base_speed_rad_s / speed_rad_s;
    const double growth_per_s = r.acceleration_rad_s2 / r.speed_rad_s;
    target.rate_wb_s = -target.flux_wb * growth_per_s;
    target.second_rate_wb_s2 =
        target.flux_wb * (2.0 * growth_per_s * growth_per_s - r.jerk_rad_s3 / r.speed_rad_s);
  }
  target.i_d_a =
      (target.flux_wb + target.rate_wb_s / machine_.flux_decay_per_s()) / machine_.mutual_inductance_h;
  return target;
}

FluxTarget FluxReference::optimum(const Reference& r, std::int64_t periods) noexcept {
  const bool braking = r.acceleration_rad_s2 * r.speed_rad_s < 0.0;
  const double share = braking ? p_.generating_share : p_.motoring_share;
  const TorqueSign sign = braking ? TorqueSign::kGenerating : TorqueSign::kMotoring;
  const double i_d_a = std::sqrt(share) * optimum_->at(r.speed_rad_s, sign).i_d_a;
  if (started_) {
    const double kept = exponential(-machine_.flux_decay_per_s() * period_s_ * static_cast<double>(periods));
    flux_wb_ = kept * flux_wb_ + (1.0 - kept) * machine_.mutual_inductance_h * last_i_d_a_;
  } else {
    started_ = true;
    flux_wb_ = machine_.mutual_inductance_h * i_d_a;
  }
  last_i_d_a_ = i_d_a;
  const double rate_wb_s = machine_.flux_decay_per_s() * (machine_.mutual_inductance_h * i_d_a - flux_wb_);
  return {.flux_wb = flux_wb_,
          .rate_wb_s = rate_wb_s,
          .second_rate_wb_s2 = -machine_.flux_decay_per_s() * rate_wb_s,
          .i_d_a = i_d_a};
}

}  // namespace drivebench::control
