#pragma once

#include "clients/control/moves/trajectory.hpp"

namespace drivebench::control {

/// From any reference to standstill, from `start_s` on:
///   ω = ω_0·(1 − u/T),  α = −ω_0/T,  θ = θ_0 + ω_0·(u − u²/2T)        with u = t − start_s
class WindDown final : public Trajectory {
 public:
  WindDown(const Reference& from, double start_s, double duration_s) noexcept
      : from_(from), start_s_(start_s), duration_s_(duration_s) {}

  Reference at(double t_s) const noexcept override;
  double duration_s() const noexcept override { return start_s_ + duration_s_; }

 private:
  Reference from_;
  double start_s_;
  double duration_s_;
};

}  // namespace drivebench::control
