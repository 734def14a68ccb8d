#include "clients/command/demo/demo_json.hpp"

#include "clients/command/common/basics/json.hpp"
#include "protocols/json.hpp"

namespace drivebench::command {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(ServerVerdict, ticks, late_ticks, worst_lateness_us, exact, realtime_valid,
                                   state_hash, recording, sentence)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(DemoReplay, equal, ticks, samples, state_hash, problem)

namespace {

Json demo_run(const DemoRun& run) {
  return {{"peak_error_counts", Json(run.control.peak_error_counts)},
          {"final_error_counts", Json(run.control.final_error_counts)},
          {"peak_current_a", run.control.peak_current_a},
          {"peak_voltage_v", run.control.peak_voltage_v.value_or(0.0)},
          {"duration_s", run.control.duration_s},
          {"samples", run.control.samples},
          {"missed_ticks", run.control.missed_ticks},
          {"late_ticks", run.verdict.late_ticks},
          {"worst_lateness_us", run.verdict.worst_lateness_us},
          {"exchange_p50_us", run.control.exchange_p50_us},
          {"exchange_p99_us", run.control.exchange_p99_us},
          {"exact", run.verdict.exact},
          {"realtime_valid", run.verdict.realtime_valid},
          {"state_hash", run.verdict.state_hash},
          {"verdict", run.verdict.sentence},
          {"recording", run.recording},
          {"attempts", run.attempts},
          {"failure", run.failure}};
}

}  // namespace

std::string demo_json(const DemoReport& report) {
  return json_text(Json{{"lockstep", demo_run(report.lockstep)},
                        {"realtime", demo_run(report.realtime)},
                        {"replay",
                         {{"equal", report.replay.equal},
                          {"ticks", report.replay.ticks},
                          {"samples", report.replay.samples},
                          {"state_hash", report.replay.state_hash},
                          {"problem", report.replay.problem}}}},
                   2);
}

std::optional<ServerVerdict> parse_verdict(std::string_view line) {
  return parsed<ServerVerdict>(line, "verdict");
}

std::optional<DemoReplay> parse_replay(std::string_view line) {
  return parsed<DemoReplay>(line);
}

}  // namespace drivebench::command
