#pragma once

#include <span>
#include <string>
#include <vector>

#include "clients/control/gains/gains.hpp"

namespace drivebench::control {

/// What a controller should follow at one instant.
struct Reference {
  double angle_rad = 0.0;
  double speed_rad_s = 0.0;
  double acceleration_rad_s2 = 0.0;
  double jerk_rad_s3 = 0.0;
};

/// References over time: rest before 0, and after duration_s() what the last instant asks for.
class Trajectory {
 public:
  Trajectory() = default;
  Trajectory(const Trajectory&) = default;
  Trajectory& operator=(const Trajectory&) = default;
  virtual ~Trajectory() = default;

  virtual Reference at(double t_s) const noexcept = 0;
  virtual double duration_s() const noexcept = 0;
};

/// A point-to-point move of cubic speed: up with ω = c1·t² + c2·t³ (c1 = 3ω_max/t1², c2 = −2ω_max/t1³),
/// cruise at ω_max, down with the mirrored cubic. Angle, speed and acceleration are continuous, the jerk is
/// not. In the book's times: t1 = ramp_up, t2 = ramp_up + cruise, t3 = t2 + ramp_down. Source: Chiasson 2005,
/// ch. 2 (TRJ-01); there both ramps are equal and ω_max = θ_f/t2 (the printed θ_f/t1 is a misprint).
struct TrajectoryParameters {
  double distance_rad;  ///< signed
  double ramp_up_s;
  double cruise_s;  ///< may be 0
  double ramp_down_s;

  static std::span<const GainRow<TrajectoryParameters>> gains() noexcept;
  /// Everything that is wrong, one sentence each; empty when the move can be made.
  std::vector<std::string> problems() const;

  double max_speed_rad_s() const noexcept;  ///< signed like the distance; a symmetric ramp covers ω_max·t1/2
  double duration_s() const noexcept;
};

/// The move at time t after its start: rest at 0 before it, rest at the distance after it.
Reference trajectory_at(const TrajectoryParameters& p, double t_s) noexcept;

/// The same as a trajectory to run. `p` must have no problems().
class CubicMove final : public Trajectory {
 public:
  explicit CubicMove(const TrajectoryParameters& p) noexcept : p_(p) {}
  Reference at(double t_s) const noexcept override { return trajectory_at(p_, t_s); }
  double duration_s() const noexcept override { return p_.duration_s(); }

 private:
  TrajectoryParameters p_;
};

}  // namespace drivebench::control
