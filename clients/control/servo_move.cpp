#include "clients/control/servo_move.hpp"

#include <cmath>

namespace drivebench::control {
namespace {

std::int64_t samples_in(double duration_s, double rate_hz) noexcept {
  return std::llround(duration_s * rate_hz);
}

}  // namespace

std::vector<std::string> MoveParameters::problems() const {
  std::vector<std::string> found = trajectory.problems();
  if (!(flux_build_up_s >= 0.0) || std::isinf(flux_build_up_s)) {
    found.emplace_back("flux_build_up_s must not be negative and must be finite");
  }
  if (!(hold_s >= 0.0) || std::isinf(hold_s))
    found.emplace_back("hold_s must not be negative and must be finite");
  return found;
}

const char* name_of(MovePhase phase) noexcept {
  switch (phase) {
    case MovePhase::kFluxBuildUp:
      return "flux build-up";
    case MovePhase::kMoving:
      return "moving";
    case MovePhase::kHolding:
      return "holding";
    case MovePhase::kDone:
      break;
  }
  return "done";
}

ServoMove::ServoMove(const ControllerParameters& controller, const MoveParameters& move) noexcept
    : controller_(controller),
      trajectory_(move.trajectory),
      period_s_(controller.period_s()),
      build_up_samples_(samples_in(move.flux_build_up_s, controller.sample_rate_hz)),
      planned_samples_(samples_in(move.flux_build_up_s + move.trajectory.duration_s() + move.hold_s,
                                  controller.sample_rate_hz)) {}

const ControlOutput& ServoMove::step(const Measurement& m, std::int64_t periods) noexcept {
  sample_ = sample_ < 0 ? 0 : sample_ + periods;
  phase_ = phase_at(sample_);
  reference_ = trajectory_at(trajectory_, time_s());
  controller_.update(m, reference_, periods);
  return controller_.output();
}

MovePhase ServoMove::phase_at(std::int64_t sample) const noexcept {
  if (sample >= planned_samples_) return MovePhase::kDone;
  if (sample < build_up_samples_) return MovePhase::kFluxBuildUp;
  const auto since_start_s = static_cast<double>(sample - build_up_samples_) * period_s_;
  return since_start_s < trajectory_.duration_s() ? MovePhase::kMoving : MovePhase::kHolding;
}

}  // namespace drivebench::control
