#pragma once

#include <span>
#include <string>
#include <vector>

#include "clients/control/gains/gains.hpp"
#include "clients/control/moves/trajectory.hpp"

namespace drivebench::control {

/// A train of equal steps of the angle, the first at time 0: what a stepping motor is given open-loop.
struct StepTrainParameters {
  double step_rad;  ///< signed
  double steps;     ///< a whole number
  double rate_hz;

  static std::span<const GainRow<StepTrainParameters>> gains() noexcept;
  std::vector<std::string> problems() const;
};

/// The angle jumps; speed and acceleration are 0. The last step lasts as long as the others.
class StepTrain final : public Trajectory {
 public:
  /// `p` must have no problems().
  explicit StepTrain(const StepTrainParameters& p) noexcept : p_(p) {}
  Reference at(double t_s) const noexcept override;
  double duration_s() const noexcept override { return p_.steps / p_.rate_hz; }

 private:
  StepTrainParameters p_;
};

}  // namespace drivebench::control
