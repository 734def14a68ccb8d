#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "clients/control/field_oriented_controller.hpp"
#include "clients/control/trajectory.hpp"

namespace drivebench::control {

struct MoveParameters {
  TrajectoryParameters trajectory;
  double
      flux_build_up_s;  ///< standing still before the move; 25 ms bring ψ to within 0.1 % of its rated value
  double hold_s;        ///< standing still after it, so that the final error can be judged

  std::vector<std::string> problems() const;
};

enum class MovePhase { kFluxBuildUp, kMoving, kHolding, kDone };

/// "flux build-up", "moving", "holding" or "done".
const char* name_of(MovePhase phase) noexcept;

/// One move of a machine at rest, sample by sample: magnetise, follow the trajectory, hold. Statistics are
/// the caller's.
///   while (!move.done()) { send(move.step(receive())); }
class ServoMove {
 public:
  /// Neither parameter set may have problems().
  ServoMove(const ControllerParameters& controller, const MoveParameters& move) noexcept;

  /// The voltages for this sample; `periods` as in FieldOrientedController::update, so that the trajectory
  /// keeps to the bench's time when samples are lost. After the end it keeps holding.
  const ControlOutput& step(const Measurement& m, std::int64_t periods = 1) noexcept;

  /// Of the last sample stepped.
  MovePhase phase() const noexcept { return phase_; }
  bool done() const noexcept { return phase_ == MovePhase::kDone; }
  const Reference& reference() const noexcept { return reference_; }
  const ControlOutput& output() const noexcept { return controller_.output(); }
  /// Since the start of the trajectory; negative while the flux builds up.
  double time_s() const noexcept { return static_cast<double>(sample_ - build_up_samples_) * period_s_; }

  /// Samples from the first one to the end of the hold, for a progress display.
  std::int64_t planned_samples() const noexcept { return planned_samples_; }

 private:
  MovePhase phase_at(std::int64_t sample) const noexcept;

  FieldOrientedController controller_;
  TrajectoryParameters trajectory_;
  double period_s_;
  std::int64_t build_up_samples_;
  std::int64_t planned_samples_;
  std::int64_t sample_ = -1;
  MovePhase phase_ = MovePhase::kFluxBuildUp;
  Reference reference_;
};

}  // namespace drivebench::control
