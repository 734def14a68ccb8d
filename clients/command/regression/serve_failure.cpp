#include "clients/command/regression/serve_failure.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <stdexcept>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/programs/composed_file.hpp"
#include "clients/command/common/programs/installation.hpp"
#include "clients/command/common/programs/process.hpp"
#include "clients/command/common/programs/server_ready.hpp"
#include "clients/command/common/programs/temporary_folder.hpp"
#include "clients/command/common/session/session.hpp"
#include "clients/command/recording/recorded_samples.hpp"

namespace drivebench::command {
namespace {

using namespace std::chrono_literals;

/// A long run is repeated before the bench is ready.
constexpr auto kRepetitionPatience = std::chrono::hours(24);
constexpr auto kServerFarewell = 20s;
constexpr auto kLook = 100ms;

}  // namespace

JudgedRecording judged_recording(const PreparedCase& prepared, const std::filesystem::path& file) {
  regression::Judge judge(*prepared.what, prepared.facts, false);
  JudgedRecording run;
  RecordedSamples recorded(file, prepared.facts.axes);
  std::vector<Sample> samples(prepared.facts.axes.size());
  while (const auto row = recorded.next()) {
    samples[row->axis] = row->sample;
    if (row->axis + 1 != samples.size() || row->sample.tick > judge.end_tick()) continue;
    judge.see(samples);
    run.last_tick = row->sample.tick;
  }
  run.failure_tick = run.last_tick;
  for (const regression::Finding& finding : judge.result().findings) {
    if (finding.passed || !finding.applied || !std::isfinite(finding.at_s)) continue;
    const auto tick = static_cast<std::uint64_t>(std::llround(finding.at_s / prepared.facts.period_s));
    run.failure_tick = std::min(run.failure_tick, tick);
  }
  return run;
}

int serve_bench(const PreparedCase& prepared, const RepeatedPart& part, unsigned port) {
  catch_interrupts();
  const TemporaryFolder folder;
  const std::filesystem::path bench = folder.path() / "bench.toml";
  write_file(bench, in_lockstep(prepared.bench_file));
  Process server({server_executable().string(), bench.string(), "--json", "--port", std::to_string(port),
                  "--repeat", part.recording.string(), "--until", std::to_string(part.until)});
  const auto ready = server.await(Process::in(kRepetitionPatience), parse_ready);
  if (!ready) throw std::runtime_error("the server did not start");
  fmt::print("{} at tick {} ({:.6g} s) on tcp:{}\n", prepared.what->name, part.until,
             static_cast<double>(part.until) * prepared.facts.period_s, ready->tcp);
  fmt::print("time stands still until a controller takes the lease; Ctrl-C ends\n");
  std::fflush(stdout);
  while (!interrupted()) {
    if (server.wait(Process::in(kLook))) throw std::runtime_error("the server has ended");
  }
  server.terminate();
  if (!server.wait(Process::in(kServerFarewell))) throw std::runtime_error("the server did not end");
  return kExitOk;
}

}  // namespace drivebench::command
