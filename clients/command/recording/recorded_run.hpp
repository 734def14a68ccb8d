#pragma once

#include <bench.pb.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "protocols/signals/sample.hpp"

namespace drivebench::command {

/// A sample of a recording that a controller answered, and the answer.
struct Answered {
  Sample sample;
  v1::Command command;
};

/// What one controller did on one axis.
struct RecordedRun {
  std::string axis;
  double period_s = 0.0;
  std::vector<Answered> rows;  ///< in the order of their ticks, at least one
  bool is_whole = true;        ///< the file: what was damaged or missing may have been part of the run
};

/// Whether a command asks for voltages or currents: gates off or shorted ask for nothing.
bool asks_for_something(const v1::Command& command) noexcept;

/// Reads the run of one axis (empty or "0": the first in the file) from its first command that asks for
/// something on, or from the tick that is named. Throws UsageError if there is none; what else is wrong with
/// the file is told on standard error.
RecordedRun read_run(const std::string& path, const std::string& axis,
                     std::optional<std::uint64_t> from_tick);

}  // namespace drivebench::command
