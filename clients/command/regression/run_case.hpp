#pragma once

#include <functional>

#include "clients/command/regression/prepared_case.hpp"
#include "clients/regression/verdicts/result.hpp"

namespace drivebench::command {

/// What a result has beside the verdict.
struct RunWishes {
  bool trace = false;   ///< the signals of the checks, for plots
  bool timing = false;  ///< of the device under test
};

/// Runs one case to its verdict: a preset, and an open bench, in this process; a program against a server of
/// its own. `folder` is private to the case. Never throws for what happens during the run.
regression::CaseResult run_case(const PreparedCase& prepared, const std::filesystem::path& folder,
                                const RunWishes& wishes);

/// Hears of every tick of a run, when its samples are there.
using SeeTick = std::function<void()>;

/// Drives the axis with the preset of a case, or with its gates off, until its last tick. The computing times
/// of the preset go to `computing`, if given.
void drive(link::AxisLink& axis, const regression::Case& c, std::uint64_t end_tick, const SeeTick& see,
           TimeHistogram* computing);

/// The case of a program: a drivebench-server in lockstep (or in real time) on a unix socket, recorded, the
/// program beside it, and the samples from the recording.
regression::CaseResult run_program_case(const PreparedCase& prepared, const std::filesystem::path& folder,
                                        const RunWishes& wishes, regression::Judge& judge);

/// Where a case leaves its recording.
std::filesystem::path recording_in(const std::filesystem::path& folder);

/// Runs the case of a preset, or of an open bench, once more over a server that records it. That of a program
/// has its recording.
void record_case(const PreparedCase& prepared, const std::filesystem::path& folder);

}  // namespace drivebench::command
