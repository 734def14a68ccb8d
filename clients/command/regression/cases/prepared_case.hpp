#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "clients/command/common/session/inproc_axis.hpp"
#include "clients/control/presets/preset.hpp"
#include "clients/regression/verdicts/judge.hpp"

/// Cases that are ready to run: their benches are composed, opened once and checked.
namespace drivebench::command {

struct PreparedCase {
  const regression::Case* what;
  std::filesystem::path bench_file;  ///< composed
  regression::RunFacts facts{};
};

/// The bench of a case: by its path from the case file, or else by its path from here or its name. Throws
/// UsageError.
std::filesystem::path bench_file_of(const regression::Case& c);

/// The gains of a preset, as control takes them.
std::vector<control::Gain> gains_of(const regression::DeviceUnderTest& device);

/// A case on a bench that is composed already, with its link. What does not fit goes to the list.
PreparedCase prepared_on(const regression::Case& c, const std::filesystem::path& bench,
                         ProblemList& problems);

/// The reason why the preset of a case cannot run on a composed bench; empty: it can. Throws UsageError if
/// there is no such preset.
std::string misfit(const regression::Case& c, const std::filesystem::path& bench);

/// The text of a composed bench in lockstep, with the delay and the arming that it has in real time.
std::string in_lockstep(const std::filesystem::path& composed, regression::DeviceUnderTest::Link link);

/// Composes the bench of every case into the folder, and opens it once, so many at a time. Throws ConfigError
/// with everything that does not fit: nothing has run then. Skipped cases are left as they are.
std::vector<PreparedCase> prepare(const std::vector<regression::Case>& cases,
                                  const std::filesystem::path& folder, unsigned jobs);

}  // namespace drivebench::command
