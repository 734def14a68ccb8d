#pragma once

#include "clients/control/moves/trajectory.hpp"

namespace drivebench::control {

/// A point-to-point move of trapezoidal speed: α = ω_max/t1, cruise, α = −ω_max/t3. The acceleration jumps,
/// so its jerk, given as 0, has an impulse at each corner. The times are those of the cubic move. Source:
/// Chiasson 2005, 2.7 and problem 2.26 (TRJ-03).
class TrapezoidalMove final : public Trajectory {
 public:
  /// `p` must have no problems().
  explicit TrapezoidalMove(const TrajectoryParameters& p) noexcept : p_(p) {}
  Reference at(double t_s) const noexcept override;
  double duration_s() const noexcept override { return p_.duration_s(); }

 private:
  TrajectoryParameters p_;
};

}  // namespace drivebench::control
