#pragma once

#include <string>
#include <tuple>
#include <vector>

#include "clients/control/gains/gains.hpp"

namespace drivebench::control {

/// The reference for a controller at one instant.
struct Reference {
  double angle_rad = 0.0;
  double speed_rad_s = 0.0;
  double acceleration_rad_s2 = 0.0;
  double jerk_rad_s3 = 0.0;
};

/// References over time: rest before 0, and after duration_s() the reference of the last instant.
class Trajectory {
 public:
  Trajectory() = default;
  Trajectory(const Trajectory&) = default;
  Trajectory& operator=(const Trajectory&) = default;
  virtual ~Trajectory() = default;

  virtual Reference at(double t_s) const noexcept = 0;
  virtual double duration_s() const noexcept = 0;
};

/// A point-to-point move: a ramp up to ω_max, a cruise, and the mirror image of a ramp down. In the book's
/// times: t1 = ramp_up, t2 = ramp_up + cruise, t3 = t2 + ramp_down; there both ramps are equal and ω_max =
/// θ_f/t2 (the printed θ_f/t1 is a misprint).
struct TrajectoryParameters {
  double distance_rad;  ///< signed
  double ramp_up_s;
  double cruise_s;  ///< may be 0
  double ramp_down_s;

  static constexpr std::tuple kGains{
      gain("move.distance_rad", &TrajectoryParameters::distance_rad),
      gain("move.ramp_up_s", &TrajectoryParameters::ramp_up_s, GainRule::kDuration),
      gain("move.cruise_s", &TrajectoryParameters::cruise_s, GainRule::kPause),
      gain("move.ramp_down_s", &TrajectoryParameters::ramp_down_s, GainRule::kDuration)};
  /// Everything that is wrong, one sentence each; empty when the move can be made.
  std::vector<std::string> problems() const { return range_problems(*this); }

  double max_speed_rad_s() const noexcept;  ///< signed like the distance; a symmetric ramp covers ω_max·t1/2
  double duration_s() const noexcept;
};

/// A ramp from rest to a speed: u after its start, with the angle covered since then.
using Ramp = Reference (*)(double max_speed_rad_s, double ramp_s, double u_s) noexcept;

/// ω = c1·u² + c2·u³ with c1 = 3ω_max/t1², c2 = −2ω_max/t1³: angle, speed and acceleration are continuous,
/// the jerk is not. Source: the book, ch. 2 (TRJ-01).
Reference cubic_ramp(double max_speed_rad_s, double ramp_s, double u_s) noexcept;
/// ω = ω_max·(10x³ − 15x⁴ + 6x⁵), x = u/t1: the jerk is continuous too, so that the voltage which the
/// reference needs has no corners. Its peaks are α = 1.875·ω_max/t1 and j = 5.7735·ω_max/t1². Source:
/// the book, problem 2.17 (TRJ-02).
Reference smooth_ramp(double max_speed_rad_s, double ramp_s, double u_s) noexcept;
/// α = ω_max/t1. The acceleration jumps, so the jerk, given as 0, has an impulse at each corner. Source:
/// the book, 2.7 and problem 2.26 (TRJ-03).
Reference linear_ramp(double max_speed_rad_s, double ramp_s, double u_s) noexcept;

/// The move at time t after its start: rest at 0 before it, rest at the distance after it.
Reference ramped_at(const TrajectoryParameters& p, double t_s, Ramp ramp) noexcept;
inline Reference trajectory_at(const TrajectoryParameters& p, double t_s) noexcept {
  return ramped_at(p, t_s, cubic_ramp);
}

/// The same as a trajectory to run. `p` must have no problems().
template <Ramp kRamp>
class RampedMove final : public Trajectory {
 public:
  explicit RampedMove(const TrajectoryParameters& p) noexcept : p_(p) {}
  Reference at(double t_s) const noexcept override { return ramped_at(p_, t_s, kRamp); }
  double duration_s() const noexcept override { return p_.duration_s(); }

 private:
  TrajectoryParameters p_;
};
using CubicMove = RampedMove<cubic_ramp>;
using JerkContinuousMove = RampedMove<smooth_ramp>;
using TrapezoidalMove = RampedMove<linear_ramp>;

}  // namespace drivebench::control
