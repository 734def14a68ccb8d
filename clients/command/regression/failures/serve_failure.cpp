#include "clients/command/regression/failures/serve_failure.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <vector>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/programs/composed_file.hpp"
#include "clients/command/common/programs/installation.hpp"
#include "clients/command/common/programs/process.hpp"
#include "clients/command/common/programs/server_ready.hpp"
#include "clients/command/common/programs/temporary_folder.hpp"
#include "clients/command/common/session/session.hpp"
#include "clients/command/regression/cases/recorded_server.hpp"
#include "clients/command/regression/cases/reference_run.hpp"
#include "clients/command/regression/cases/server_report.hpp"
#include "clients/regression/checks/check_kinds.hpp"

namespace drivebench::command {
namespace {

using namespace std::chrono_literals;

constexpr auto kServerFarewell = 20s;
constexpr auto kLook = 100ms;

/// The first tick after which one of the checks has failed, which all do at a sample.
std::uint64_t first_failure(const PreparedCase& prepared, const std::filesystem::path& file) {
  regression::Judge judge(*prepared.what, prepared.facts, false);
  std::uint64_t tick = 0;
  see_recording(file, prepared.facts, [&](const std::vector<Sample>& samples) {
    judge.see(samples);
    tick = samples[0].tick;
    return std::ranges::none_of(judge.result().findings, [](const regression::Finding& finding) {
      return !finding.passed && finding.applied;
    });
  });
  return tick;
}

/// A fault that the recorded run has latched stays, and refuses commands.
void print_latched(const std::string& address) {
  link::Link bench(address, {.client = "drivebench rerun", .token = {}});
  const v1::BenchDescription& description = bench.welcome().bench();
  for (const link::AxisSample& each : bench.exchange({})) {
    const auto axis = static_cast<int>(each.axis);
    if (!description.axes(axis).shares_amplifier_with().empty()) continue;  // latches with the owner
    const std::string latched = latched_text(description, each.sample);
    if (latched.empty()) continue;
    const std::string& name = description.axes(axis).name();
    fmt::print("{} has latched {}; first: drivebench clear {} --link {}\n", name, latched, name, address);
  }
}

}  // namespace

JudgedRecording judged_recording(const PreparedCase& recorded, const std::filesystem::path& file) {
  const ReferencedCase referenced(recorded);
  const PreparedCase& prepared = referenced.prepared();
  regression::Judge judge(*prepared.what, prepared.facts, false);
  JudgedRecording run;
  see_recording(file, prepared.facts, [&](const std::vector<Sample>& samples) {
    if (judge.is_over(samples[0].tick)) return false;
    judge.see(samples);
    run.last_tick = samples[0].tick;
    return true;
  });
  run.failure_tick = run.last_tick;
  regression::Case at_once = *prepared.what;
  at_once.checks.clear();
  const std::vector<regression::Finding> findings = judge.result().findings;
  for (std::size_t i = 0; i < findings.size(); ++i) {
    const regression::Finding& finding = findings[i];
    if (finding.passed || !finding.applied) continue;
    if (regression::fails_at_once(finding.kind)) {
      at_once.checks.push_back(prepared.what->checks[i]);
    } else if (std::isfinite(finding.at_s)) {
      const auto tick = static_cast<std::uint64_t>(std::llround(finding.at_s / prepared.facts.period_s));
      run.failure_tick = std::min(run.failure_tick, judge.begin_tick().value_or(0) + tick);
    }
  }
  if (!at_once.checks.empty()) {
    run.failure_tick = std::min(
        run.failure_tick, first_failure({.what = &at_once, .bench_file = {}, .facts = prepared.facts}, file));
  }
  return run;
}

int serve_bench(const PreparedCase& prepared, const RepeatedPart& part, unsigned port) {
  const TemporaryFolder folder;
  const std::filesystem::path bench = folder.path() / "bench.toml";
  write_file(bench, in_lockstep(prepared.bench_file, regression::DeviceUnderTest::Link::kUnix));
  Process server({server_executable().string(), bench.string(), "--json", "--port", std::to_string(port),
                  "--repeat", part.recording.string(), "--until", std::to_string(part.until)});
  const auto ready = await_answer(server, kRepetitionPatience, parse_ready);
  if (!ready) throw std::runtime_error("the server did not start");
  const std::string address = "tcp:" + ready->tcp;
  fmt::print("{} at tick {} ({:.6g} s) on {}\n", prepared.what->name, part.until,
             static_cast<double>(part.until) * prepared.facts.period_s, address);
  print_latched(address);
  fmt::print("time stands still until a controller takes the lease; Ctrl-C ends\n");
  std::fflush(stdout);
  while (!interrupted()) {
    // Ctrl-C in a terminal ends the server, too.
    if (server.wait(Process::in(kLook)) && !interrupted()) throw std::runtime_error("the server has ended");
  }
  server.terminate();
  if (!server.wait(Process::in(kServerFarewell))) throw std::runtime_error("the server did not end");
  return kExitOk;
}

}  // namespace drivebench::command
