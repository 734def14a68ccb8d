#pragma once

#include <cstddef>
#include <string>
#include <tuple>
#include <vector>

#include "clients/control/gains/gains.hpp"
#include "clients/control/induction/optimum_torque_induction.hpp"
#include "clients/control/moves/trajectory.hpp"

namespace drivebench::control {

/// A run up to a speed and back to rest, without a cruise.
struct TorqueMoveParameters {
  double top_speed_rad_s;
  double run_up_s;
  double run_down_s;
  double torque_ramp_s;  ///< at both ends of either phase the torque is faded by 3x² − 2x³

  static constexpr std::tuple kGains{
      gain("move.top_speed_rad_s", &TorqueMoveParameters::top_speed_rad_s, GainRule::kPositive),
      gain("move.run_up_s", &TorqueMoveParameters::run_up_s, GainRule::kDuration),
      gain("move.run_down_s", &TorqueMoveParameters::run_down_s, GainRule::kDuration),
      gain("move.torque_ramp_s", &TorqueMoveParameters::torque_ramp_s, GainRule::kDuration)};
  std::vector<std::string> problems() const;
};

/// The move that takes the same share k of the optimum torque at every speed:
///   J·dω/dt = k·fade(t)·τ_opt(ω) − f·ω        θ' = ω
/// with the k that reaches the top speed, or rest, in just the time given: one for motoring and one for
/// generating. A share above 1 is a move that the limits behind τ_opt do not allow; it is made all the same,
/// so that first_exceeded() can say where. The book gives times and speed and says that τ_ref is close to the
/// optimum; share and fade are an assumption. Source: the book, 8.2.5 and 8.4 (IMX-02).
class TorqueOptimalMove final : public Trajectory {
 public:
  /// `p` must have no problems(). Throws std::invalid_argument when even four times the optimum torque does
  /// not get there, or no torque brakes in less than the time given.
  TorqueOptimalMove(const TorqueMoveParameters& p, const OptimumTorqueTable& optimum,
                    const InductionMachineModel& machine);

  Reference at(double t_s) const noexcept override;
  double duration_s() const noexcept override { return parameters_.run_up_s + parameters_.run_down_s; }

  double motoring_share() const noexcept { return motoring_share_; }
  double generating_share() const noexcept { return generating_share_; }

 private:
  TorqueMoveParameters parameters_;
  double motoring_share_ = 0.0;
  double generating_share_ = 0.0;
  std::vector<Reference> points_;  // evenly over the run up, then over the run down; quintic between them
  std::size_t up_steps_ = 0;
};

}  // namespace drivebench::control
