#pragma once

#include "clients/control/moves/trajectory.hpp"

namespace drivebench::control {

/// A point-to-point move whose jerk is continuous too, so that the voltage which the reference needs has no
/// corners: up with ω = ω_max·(10x³ − 15x⁴ + 6x⁵), x = t/t1, cruise, down with the mirror image. Its peaks
/// are α = 1.875·ω_max/t1 and j = 5.7735·ω_max/t1². The times are those of the cubic move. Source: Chiasson
/// 2005, problem 2.17 (TRJ-02).
class JerkContinuousMove final : public Trajectory {
 public:
  /// `p` must have no problems().
  explicit JerkContinuousMove(const TrajectoryParameters& p) noexcept : p_(p) {}
  Reference at(double t_s) const noexcept override;
  double duration_s() const noexcept override { return p_.duration_s(); }

 private:
  TrajectoryParameters p_;
};

/// From rest to a speed on the first ramp of the same curve, and on with it.
struct SpeedRampParameters {
  double speed_rad_s;  ///< signed
  double ramp_s;
  double cruise_s;  ///< may be 0

  static std::span<const GainRow<SpeedRampParameters>> gains() noexcept;
  std::vector<std::string> problems() const { return range_problems(*this); }
};

class SpeedRamp final : public Trajectory {
 public:
  /// `p` must have no problems().
  explicit SpeedRamp(const SpeedRampParameters& p) noexcept : p_(p) {}
  Reference at(double t_s) const noexcept override;
  double duration_s() const noexcept override { return p_.ramp_s + p_.cruise_s; }

 private:
  SpeedRampParameters p_;
};

}  // namespace drivebench::control
