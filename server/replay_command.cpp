#include "server/replay_command.hpp"

#include <fmt/core.h>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "protocols/mcap/mcap_series.hpp"
#include "protocols/mcap/time_base.hpp"
#include "server/host/logging/print_line.hpp"
#include "server/recording/replay.hpp"

namespace drivebench {
namespace {

using Result = ReplayReport::Result;

nlohmann::json as_json(const ReplayReport& report) {
  nlohmann::json json{{"equal", report.result == Result::kEqual},
                      {"usable", report.result != Result::kUnusable},
                      {"ends_early", report.result == Result::kEqualWithoutEnd},
                      {"ticks", report.ticks},
                      {"samples", report.samples},
                      {"inputs", report.inputs},
                      {"state_hash", fmt::format("{:016x}", report.state_hash)},
                      {"recorded_by", report.recorded_by},
                      {"same_build", report.same_build},
                      {"problem", report.problem}};
  if (report.begun_unix_ns) json["begun_utc"] = utc_text(*report.begun_unix_ns);
  if (report.difference) {
    json["first_difference"] = {{"tick", report.difference->tick},
                                {"axis", report.difference->axis},
                                {"signal", report.difference->signal},
                                {"recorded", report.difference->recorded},
                                {"replayed", report.difference->replayed}};
  }
  return json;
}

std::string verdict_of(const ReplayReport& report) {
  switch (report.result) {
    case Result::kEqual:
      return "equal, bit for bit";
    case Result::kEqualWithoutEnd:
      return fmt::format("equal up to tick {}; the recording has no end", report.ticks);
    case Result::kDifferent:
      return "DIFFERENT";
    case Result::kUnusable:
      break;
  }
  return "cannot be replayed";
}

int exit_code_of(Result result) {
  switch (result) {
    case Result::kEqual:
      return 0;
    case Result::kEqualWithoutEnd:
      return 3;
    case Result::kDifferent:
      return 1;
    case Result::kUnusable:
      break;
  }
  return 2;
}

}  // namespace

int replay_command(const std::string& file, bool json) {
  const MappedSeries series(file);
  const bool terminal = ::isatty(STDERR_FILENO) != 0;
  const ReplayReport report = replay(
      series.segments(),
      terminal ? +[](double share) { fmt::print(stderr, "\rreplaying {:3.0f} %", 100.0 * share); } : nullptr);
  if (terminal) fmt::print(stderr, "\r                \r");
  if (json) {
    print_line(as_json(report));
  } else {
    print_line(fmt::format("{}: {} ({} ticks, {} samples, {} inputs, state hash {:016x}, recorded by {}{})",
                           file, verdict_of(report), report.ticks, report.samples, report.inputs,
                           report.state_hash,
                           report.recorded_by.empty() ? "an unknown program"
                           : report.same_build        ? report.recorded_by
                                                      : report.recorded_by + ", not by this build",
                           report.begun_unix_ns ? ", begun " + utc_text(*report.begun_unix_ns) : ""));
    if (!report.problem.empty()) print_line("  " + report.problem);
  }
  return exit_code_of(report.result);
}

}  // namespace drivebench
