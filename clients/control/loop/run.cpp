#include "clients/control/loop/run.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "clients/control/moves/wind_down.hpp"

namespace drivebench::control {
namespace {

std::int64_t samples_in(double duration_s, double rate_hz) noexcept {
  return std::llround(duration_s * rate_hz);
}

/// The number of samples of the whole run.
std::int64_t checked_samples(double duration_s, double rate_hz) {
  constexpr double kMostSamples = 1e9;
  if (!(duration_s <= kLongestRun_s)) {
    throw std::invalid_argument("prepare, move and hold must together last at most " +
                                std::to_string(std::lround(kLongestRun_s)) + " s");
  }
  if (!(duration_s * rate_hz <= kMostSamples)) {
    throw std::invalid_argument("the run would have more than 1e9 samples");
  }
  const std::int64_t samples = samples_in(duration_s, rate_hz);
  if (samples < 1) throw std::invalid_argument("the run would be over before its first sample");
  return samples;
}

}  // namespace

const char* name_of(RunPhase phase) noexcept {
  switch (phase) {
    case RunPhase::kPreparing:
      return "preparing";
    case RunPhase::kMoving:
      return "moving";
    case RunPhase::kHolding:
      return "holding";
    case RunPhase::kDone:
      break;
  }
  return "done";
}

Run::Run(std::unique_ptr<Controller> controller, std::shared_ptr<const Trajectory> trajectory,
         const RunTiming& timing)
    : controller_(std::move(controller)),
      trajectory_(std::move(trajectory)),
      timing_(timing),
      period_s_(1.0 / timing.sample_rate_hz),
      prepare_samples_(samples_in(timing.prepare_s, timing.sample_rate_hz)),
      planned_samples_(checked_samples(timing.prepare_s + trajectory_->duration_s() + timing.hold_s,
                                       timing.sample_rate_hz)) {}

Setpoint Run::step(const Measurement& m, std::int64_t periods) noexcept {
  sample_ = sample_ < 0 ? 0 : sample_ + periods;
  phase_ = phase_at(sample_);
  reference_ = trajectory_->at(time_s());
  return controller_->update(m, reference_, periods);
}

void Run::wind_down(double duration_s) {
  trajectory_ = std::make_shared<WindDown>(reference_, time_s(), duration_s);
  planned_samples_ = std::max<std::int64_t>(sample_, 0) + samples_in(duration_s, timing_.sample_rate_hz);
}

RunPhase Run::phase_at(std::int64_t sample) const noexcept {
  if (sample >= planned_samples_) return RunPhase::kDone;
  if (sample < prepare_samples_) return RunPhase::kPreparing;
  const auto since_start_s = static_cast<double>(sample - prepare_samples_) * period_s_;
  return since_start_s < trajectory_->duration_s() ? RunPhase::kMoving : RunPhase::kHolding;
}

}  // namespace drivebench::control
