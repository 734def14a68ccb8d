#pragma once

#include <bench.pb.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "protocols/signals/sample.hpp"

namespace drivebench::command {

/// A sample of a recording and the controller's answer.
struct Answered {
  Sample sample;
  v1::Command command;
  std::int64_t due_unix_ns = 0;  ///< UTC since 1970 at which the sample was due; only of a run in real time
};

/// The run of one controller on one axis.
struct RecordedRun {
  std::string axis;
  double period_s = 0.0;
  std::vector<Answered> rows;  ///< in the order of their ticks, at least one
  /// All samples of the axis that shares the amplifier of this one, in the order of their ticks.
  std::vector<Sample> second{};
  bool is_real_time = false;
  bool is_whole = true;  ///< false: a damaged or missing part of the file may belong to the run

  /// Null: there is none.
  const Sample* second_at(std::uint64_t tick) const noexcept;
};

/// Whether a command has voltages or currents as set-points, in contrast to gates off or a short circuit.
bool asks_for_something(const v1::Command& command) noexcept;

/// Reads the run of one axis (empty or "0": the first in the file), from the first command with set-points or
/// from the given tick on. Throws UsageError if there is none; prints other problems of the file to standard
/// error.
RecordedRun read_run(const std::string& path, const std::string& axis,
                     std::optional<std::uint64_t> from_tick);

/// All samples of one axis, those without an answer with an empty command, from the given tick on, or from
/// the first command with set-points, or from the beginning if there is none. Otherwise as read_run().
RecordedRun read_samples(const std::string& path, const std::string& axis,
                         std::optional<std::uint64_t> from_tick);

}  // namespace drivebench::command
