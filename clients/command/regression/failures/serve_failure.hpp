#pragma once

#include <cstdint>

#include "clients/command/regression/cases/run_case.hpp"

namespace drivebench::command {

/// What the checks of a case see in a recording of it.
struct JudgedRecording {
  std::uint64_t last_tick = 0;
  /// Where the first of the checks that failed did so; of one that judges its window as a whole, where it was
  /// worst. The last tick if none failed.
  std::uint64_t failure_tick = 0;
};

/// Throws std::runtime_error if the recording is not whole.
JudgedRecording judged_recording(const PreparedCase& prepared, const std::filesystem::path& file);

/// Serves the bench of a case over TCP, in lockstep, from the end of the repeated part on and with free
/// leases, until the user interrupts. Returns the exit code.
int serve_bench(const PreparedCase& prepared, const RepeatedPart& part, unsigned port);

}  // namespace drivebench::command
