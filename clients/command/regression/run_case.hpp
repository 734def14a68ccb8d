#pragma once

#include "clients/command/regression/prepared_case.hpp"
#include "clients/regression/verdicts/result.hpp"

namespace drivebench::command {

/// Runs one case to its verdict: a preset, and an open bench, in this process; a program against a server of
/// its own. `folder` is private to the case. Never throws for what happens during the run.
regression::CaseResult run_case(const PreparedCase& prepared, const std::filesystem::path& folder,
                                bool keeps_trace);

/// The case of a program: a drivebench-server in lockstep (or in real time) on a unix socket, recorded, the
/// program beside it, and the samples from the recording.
regression::CaseResult run_program_case(const PreparedCase& prepared, const std::filesystem::path& folder,
                                        regression::Judge& judge);

}  // namespace drivebench::command
