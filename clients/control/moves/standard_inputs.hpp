#pragma once

#include "clients/control/moves/trajectory.hpp"

/// References that no machine can follow or that are followed for ever: what loops are tested with.
namespace drivebench::control {

/// The angle jumps at time 0 and goes on at constant speed.
struct StepMoveParameters {
  double distance_rad;
  double speed_rad_s;
  double duration_s;

  static std::span<const GainRow<StepMoveParameters>> gains() noexcept;
  std::vector<std::string> problems() const { return range_problems(*this); }
};

class StepMove final : public Trajectory {
 public:
  /// `p` must have no problems().
  explicit StepMove(const StepMoveParameters& p) noexcept : p_(p) {}
  Reference at(double t_s) const noexcept override;
  double duration_s() const noexcept override { return p_.duration_s; }

 private:
  StepMoveParameters p_;
};

/// The angle of a sine from time 0 on, θ = A·sin(Ωt): its speed jumps there.
struct SineMoveParameters {
  double amplitude_rad;
  double angular_frequency_rad_s;
  double duration_s;

  static std::span<const GainRow<SineMoveParameters>> gains() noexcept;
  std::vector<std::string> problems() const { return range_problems(*this); }
};

class SineMove final : public Trajectory {
 public:
  /// `p` must have no problems().
  explicit SineMove(const SineMoveParameters& p) noexcept : p_(p) {}
  Reference at(double t_s) const noexcept override;
  double duration_s() const noexcept override { return p_.duration_s; }

 private:
  SineMoveParameters p_;
};

/// The motion that a sinusoidal torque makes of a shaft at rest with friction: α + (f/J)·ω = A·sin(Ωt). A
/// controller that works out the current of the reference gets the sine back.
struct SineTorqueMoveParameters {
  double amplitude_rad_s2;         ///< A: torque over inertia
  double angular_frequency_rad_s;  ///< Ω
  double friction_rate_per_s;      ///< f/J
  double duration_s;

  static std::span<const GainRow<SineTorqueMoveParameters>> gains() noexcept;
  std::vector<std::string> problems() const { return range_problems(*this); }
};

class SineTorqueMove final : public Trajectory {
 public:
  /// `p` must have no problems().
  explicit SineTorqueMove(const SineTorqueMoveParameters& p) noexcept : p_(p) {}
  Reference at(double t_s) const noexcept override;
  double duration_s() const noexcept override { return p_.duration_s; }

 private:
  SineTorqueMoveParameters p_;
};

}  // namespace drivebench::control
