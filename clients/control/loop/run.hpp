#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <tuple>
#include <vector>

#include "clients/control/gains/gains.hpp"
#include "clients/control/loop/controller.hpp"
#include "clients/control/moves/trajectory.hpp"

namespace drivebench::control {

/// The times of a run.
struct RunTiming {
  double sample_rate_hz;  ///< the controller's; not a gain of its own
  double prepare_s;       ///< at rest before the move: flux build-up, alignment
  double hold_s;          ///< the end of the trajectory holds this long, so that it can be judged

  static constexpr std::tuple kGains{gain("run.prepare_s", &RunTiming::prepare_s, GainRule::kPause),
                                     gain("run.hold_s", &RunTiming::hold_s, GainRule::kPause)};
  std::vector<std::string> problems() const { return range_problems(*this); }
};

enum class RunPhase { kPreparing, kMoving, kHolding, kDone };

/// "preparing", "moving", "holding" or "done".
const char* name_of(RunPhase phase) noexcept;

/// One run of a controller on an axis, sample by sample: prepare, follow the trajectory, hold. Statistics are
/// the caller's.
///   while (!run.done()) send(run.step(receive()));
class Run {
 public:
  /// `timing` must have no problems(). Throws std::invalid_argument if all of it is longer than a run may be,
  /// or shorter than a sample.
  Run(std::unique_ptr<Controller> controller, std::shared_ptr<const Trajectory> trajectory,
      const RunTiming& timing);

  /// The set-point for this sample; `periods` as in Controller::update, so that the trajectory keeps to the
  /// bench's time when samples are lost. After the end it keeps holding.
  Setpoint step(const Measurement& m, std::int64_t periods = 1) noexcept;

  /// Leaves the trajectory after the last sample: from its reference the speed goes to zero in a straight
  /// line over `duration_s`, and then the run is done.
  void wind_down(double duration_s);

  /// The phase of the last sample.
  RunPhase phase() const noexcept { return phase_; }
  bool done() const noexcept { return phase_ == RunPhase::kDone; }
  const Reference& reference() const noexcept { return reference_; }
  const Controller& controller() const noexcept { return *controller_; }
  /// The time since the start of the trajectory; negative before it.
  double time_s() const noexcept { return static_cast<double>(sample_ - prepare_samples_) * period_s_; }

  const Trajectory& trajectory() const noexcept { return *trajectory_; }
  const RunTiming& timing() const noexcept { return timing_; }
  double period_s() const noexcept { return period_s_; }
  std::int64_t prepare_samples() const noexcept { return prepare_samples_; }
  /// Samples from the first one to the end of the hold.
  std::int64_t planned_samples() const noexcept { return planned_samples_; }

 private:
  RunPhase phase_at(std::int64_t sample) const noexcept;

  std::unique_ptr<Controller> controller_;
  std::shared_ptr<const Trajectory> trajectory_;
  RunTiming timing_;
  double period_s_;
  std::int64_t prepare_samples_;
  std::int64_t planned_samples_;
  std::int64_t sample_ = -1;
  RunPhase phase_ = RunPhase::kPreparing;
  Reference reference_;
};

}  // namespace drivebench::control
