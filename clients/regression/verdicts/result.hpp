#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "clients/regression/checks/check.hpp"
#include "clients/regression/checks/trace.hpp"
#include "clients/regression/timing/device_timing.hpp"

namespace drivebench::regression {

enum class Verdict {
  kPass,
  kFail,     ///< a check failed
  kError,    ///< the device under test died, timed out, never armed, or the bench refused the run
  kInvalid,  ///< real time was not kept: the bench is to blame, not the device
  kSkipped
};

/// "pass", "fail", "error", "invalid" or "skipped".
std::string_view word_of(Verdict verdict) noexcept;

/// The outcome of a case.
struct CaseResult {
  std::string name;
  std::string file;
  int line = 1;
  std::vector<std::pair<std::string, std::string>> values{};
  std::vector<std::string> tags{};
  Verdict verdict = Verdict::kError;
  std::string reason{};  ///< of an error, an invalid run or a skipped case
  std::vector<Finding> findings{};
  double bench_s = 0.0;       ///< how long it lasted on the bench
  std::uint64_t samples = 0;  ///< of all axes
  std::uint64_t hash = 0;     ///< of all samples: equal hashes mean equal runs
  double wall_s = 0.0;
  std::string output{};                          ///< what the device under test printed, its end
  std::vector<std::string> messages{};           ///< that the device under test was sent, with their times
  Trace trace{};                                 ///< empty once the plots are drawn
  std::vector<std::string> plots{};              ///< of failed checks, as SVG
  std::shared_ptr<const DeviceTiming> timing{};  ///< if it was measured; in no report but its own
};

}  // namespace drivebench::regression
