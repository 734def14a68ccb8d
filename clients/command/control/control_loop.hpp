#pragma once

#include <cstdint>

#include "clients/control/loop/run.hpp"
#include "clients/link/common/axis_link.hpp"
#include "clients/reference/answers.hpp"

/// The loop of a controller over any link: a sample comes in, its answer goes out.
namespace drivebench::command {

using reference::measurement_of;

/// A sample of the loop and the controller's answer to it.
struct LoopStep {
  const Sample& sample;
  const control::Measurement& measured;
  const control::Setpoint& setpoint;
  std::int64_t periods;  ///< since the previous sample
};

/// What the loop does with an answer.
enum class Answer {
  kSend,
  kGatesOff,  ///< sends a command with the gates off instead
  kEnd        ///< ends the loop
};

/// Watches a loop, and ends it.
class LoopWatcher {
 public:
  LoopWatcher() = default;
  LoopWatcher(const LoopWatcher&) = delete;
  LoopWatcher& operator=(const LoopWatcher&) = delete;
  virtual ~LoopWatcher() = default;

  /// Before the answer goes out.
  virtual Answer answering(const LoopStep& step) = 0;
  /// After the next sample has come; returns it, or a newer one of the same axis.
  virtual const Sample& answered(const Sample& next) { return next; }
};

/// Runs a controller on an axis that is leased and at rest, until the watcher ends the loop. After the end of
/// its plan the controller keeps holding.
void control_loop(link::AxisLink& bench, control::Run& run, LoopWatcher& watcher);

}  // namespace drivebench::command
