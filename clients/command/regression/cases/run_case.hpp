#pragma once

#include <filesystem>
#include <functional>
#include <optional>

#include "clients/command/regression/cases/prepared_case.hpp"
#include "clients/regression/verdicts/result.hpp"

namespace drivebench::command {

/// The beginning of a run that a recording has: its commands and other inputs act again.
struct RepeatedPart {
  std::filesystem::path recording;
  std::uint64_t until;  ///< the tick from which the device under test drives
};

/// What a result has beside the verdict, and where the run begins.
struct RunWishes {
  bool trace = false;   ///< the signals of the checks, for plots
  bool timing = false;  ///< of the device under test
  std::optional<RepeatedPart> repeats{};
};

/// Runs one case to its verdict: a preset, and an open bench, in this process; a program against a server of
/// its own. `folder` is private to the case. Never throws for what happens during the run.
regression::CaseResult run_case(const PreparedCase& prepared, const std::filesystem::path& folder,
                                const RunWishes& wishes);

/// Hears of every tick of a run, when its samples are there.
using SeeTick = std::function<void()>;

/// How a case is driven without a program.
struct Drive {
  std::uint64_t end_tick;
  const std::optional<RepeatedPart>& repeats;
  TimeHistogram* computing = nullptr;  ///< takes the computing times of the preset, if given
};

/// Drives the axis with the preset of a case, or with its gates off, until its last tick. A preset sees the
/// part that is repeated, but the recorded commands act.
void drive(link::AxisLink& bench, const regression::Case& c, const SeeTick& see, const Drive& how);

/// The case of a program: a drivebench-server in lockstep (or in real time) on a unix socket, recorded, the
/// program beside it, and the samples from the recording.
regression::CaseResult run_program_case(const PreparedCase& prepared, const std::filesystem::path& folder,
                                        const RunWishes& wishes, regression::Judge& judge);

/// The case of a drive that runs already: serves the bench in real time where the drive waits for it, until
/// the drive arms and the case is over, and leaves the drive as it is.
regression::CaseResult run_attached_case(const PreparedCase& prepared, const std::filesystem::path& folder,
                                         const RunWishes& wishes, regression::Judge& judge);

/// Throws std::runtime_error once the user has interrupted what runs.
void end_if_interrupted();

/// Where a case leaves its recording.
std::filesystem::path recording_in(const std::filesystem::path& folder);

/// Runs the case of a preset, or of an open bench, once more over a server that records it. That of a program
/// has its recording.
void record_case(const PreparedCase& prepared, const std::filesystem::path& folder,
                 const std::optional<RepeatedPart>& repeats = {});

}  // namespace drivebench::command
