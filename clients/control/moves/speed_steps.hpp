#pragma once

#include <span>
#include <string>
#include <vector>

#include "clients/control/gains/gains.hpp"
#include "clients/control/moves/trajectory.hpp"

namespace drivebench::control {

/// A speed from one moment to the next, for so long, and then another: what a drive is asked for that has to
/// show how fast it can be.
struct SpeedStepsParameters {
  double first_rad_s;
  double first_s;  ///< how long
  double second_rad_s;
  double second_s;

  static std::span<const GainRow<SpeedStepsParameters>> gains() noexcept;
  std::vector<std::string> problems() const;
};

/// The angle is that of the speeds, the acceleration 0.
class SpeedSteps final : public Trajectory {
 public:
  /// `p` must have no problems().
  explicit SpeedSteps(const SpeedStepsParameters& p) noexcept : p_(p) {}
  Reference at(double t_s) const noexcept override;
  double duration_s() const noexcept override { return p_.first_s + p_.second_s; }

 private:
  SpeedStepsParameters p_;
};

}  // namespace drivebench::control
