#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <optional>
#include <thread>

#include "clients/command/common/programs/composed_file.hpp"
#include "clients/command/common/programs/process.hpp"
#include "clients/command/common/session/session.hpp"
#include "clients/command/regression/cases/recorded_server.hpp"
#include "clients/command/regression/cases/run_case.hpp"
#include "protocols/text.hpp"

namespace drivebench::command {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using regression::Case;
using regression::CaseResult;
using regression::Judge;
using regression::RunFacts;
using regression::Verdict;

constexpr auto kPoll = 2ms;
/// The device under test may end by itself for so long, once its bench is gone.
constexpr auto kFarewell = 2s;

/// The output without the address of this run, so that equal runs give equal reports.
std::string without_place(std::string text, const std::string& link) {
  for (std::size_t at = text.find(link); at != std::string::npos; at = text.find(link, at))
    text.replace(at, link.size(), "DRIVEBENCH_LINK");
  return text;
}

constexpr const char* kOutput = "output.txt";

/// Waits until the bench has come to the end of the case, or the program has ended. Returns the reason why
/// the run is none; empty: it is one.
std::string await_end(Process& program, BenchView& bench, const Case& c, const RunFacts& facts) {
  const auto deadline = Process::in(std::chrono::milliseconds(std::llround(c.device.time_limit_s * 1e3)));
  const auto at = [&](std::uint64_t tick) { return static_cast<double>(tick) * facts.period_s; };
  for (;;) {
    const std::optional<int> code =
        program.wait(Process::in(0ms));  // before the tick: it may end with the last one
    const std::uint64_t tick = bench.newest(0).tick;
    if (tick >= facts.end_tick) return {};
    if (code) {
      if (*code == 127) return fmt::format("the device under test {} cannot be started", c.device.command[0]);
      if (*code == 0 && !c.duration_s) return {};
      const std::string when = c.duration_s ? fmt::format("at {:.6g} s of {:.6g} s", at(tick), *c.duration_s)
                                            : fmt::format("at {:.6g} s", at(tick));
      return fmt::format("the device under test ended with code {} {}", *code, when);
    }
    if (interrupted()) return "interrupted";
    if (std::chrono::steady_clock::now() >= deadline) {
      return fmt::format("the time limit of {:.6g} s passed at {:.6g} s of the bench", c.device.time_limit_s,
                         at(tick));
    }
    std::this_thread::sleep_for(kPoll);
  }
}

/// What a run in real time must tell to be repeated in lockstep.
struct RealtimeRun {
  std::uint64_t leased_tick = 0;  ///< the last one before the device took its lease
  std::uint64_t last_tick = 0;
  bool was_leased = false;

  void see(const Sample& sample) noexcept {
    was_leased = was_leased || sample.owner != 0;
    if (!was_leased) leased_tick = sample.tick;
    last_tick = sample.tick;
  }
};

/// The end of a program beside a bench.
struct ProgramEnd {
  std::string failure;  ///< the reason why the run is none; empty: it is one
  ServerReport report;
  std::string output;
};

/// Runs the device under test beside a server of its own, which leaves its recording in the folder.
ProgramEnd run_beside_server(const PreparedCase& prepared, const fs::path& folder, const RunWishes& wishes) {
  const Case& c = *prepared.what;
  const fs::path output = folder / kOutput;
  RecordedServer server(prepared, folder, wishes);
  BenchView bench(server.link());
  const std::string link = server.link(c.device.link, find_axis(prepared.facts, c.device.axis));
  Process program(c.device.command, {.environment = {"DRIVEBENCH_LINK=" + link},
                                     .folder = fs::absolute(c.file).parent_path().string(),
                                     .error_file = output.string(),
                                     .input_file = server.lines(),
                                     .joins_output = true,
                                     .own_group = true});
  ProgramEnd end{
      .failure = await_end(program, bench, c, prepared.facts), .report = server.end(), .output = {}};
  if (!program.wait(Process::in(end.failure.empty() ? kFarewell : 0s))) program.terminate();
  program.wait(Process::in(kFarewell));
  end.output = utf8(without_place(tail_of(output), link));
  return end;
}

/// The signals of the checks in the recording in a folder.
regression::Trace traced(const PreparedCase& prepared, const fs::path& folder) {
  Judge judge(*prepared.what, prepared.facts, true);
  see_recording(recording_in(folder), prepared.facts, [&](const std::vector<Sample>& samples) {
    judge.see(samples);
    return true;
  });
  return judge.failure(Verdict::kPass, "").trace;
}

/// The case in lockstep: the run in real time is repeated up to the tick in which the device took its lease,
/// and the device starts there anew.
regression::MissedEffect effect_of_missed(const PreparedCase& prepared, const fs::path& folder,
                                          const RealtimeRun& run) {
  const double from_s = static_cast<double>(run.leased_tick) * prepared.facts.period_s;
  const fs::path in_time = folder / "in-time";
  fs::create_directory(in_time);
  Case c = *prepared.what;
  c.is_realtime = false;
  PreparedCase again{.what = &c, .bench_file = in_time / "bench.toml", .facts = prepared.facts};
  again.facts.end_tick = run.last_tick;
  try {
    write_file(again.bench_file, in_lockstep(prepared.bench_file, c.device.link));
    const ProgramEnd end =
        run_beside_server(again, in_time, {.repeats = RepeatedPart{recording_in(folder), run.leased_tick}});
    if (!end.failure.empty()) return {.from_s = from_s, .problem = "in lockstep " + end.failure};
    return regression::missed_effect(traced(prepared, folder), traced(again, in_time), from_s);
  } catch (const std::exception& error) {
    return {.from_s = from_s, .problem = error.what()};
  }
}

}  // namespace

CaseResult run_program_case(const PreparedCase& prepared, const fs::path& folder, const RunWishes& wishes,
                            Judge& judge) {
  const Case& c = *prepared.what;
  const ProgramEnd end = run_beside_server(prepared, folder, wishes);
  const std::size_t place = find_axis(prepared.facts, c.device.axis);
  regression::MissedTicks missed;
  RealtimeRun run;
  see_recording(recording_in(folder), prepared.facts, [&](const std::vector<Sample>& samples) {
    if (judge.is_over(samples[place].tick)) return false;
    judge.see(samples);
    missed.see(samples[place]);
    run.see(samples[place]);
    return true;
  });
  CaseResult result = end.failure.empty() ? judge.result() : judge.failure(Verdict::kError, end.failure);
  result.output = end.output;
  add_messages(end.report.messages, 0, prepared.facts.period_s, result);
  if (place >= end.report.answers.size()) return result;
  using enum regression::DeviceTiming::Way;
  const auto timing = std::make_shared<regression::DeviceTiming>(
      regression::DeviceTiming{.way = c.is_realtime ? kRealtime : kLockstep,
                               .period_ns = std::llround(prepared.facts.period_s * 1e9),
                               .answers = end.report.answers[place],
                               .missed = missed});
  const bool came_late = timing->answers.late != 0 || missed.all != 0;
  if (c.is_realtime && came_late && run.was_leased && end.failure.empty())
    timing->effect = effect_of_missed(prepared, folder, run);
  result.timing = timing;
  return result;
}

void record_case(const PreparedCase& prepared, const fs::path& folder,
                 const std::optional<RepeatedPart>& repeats) {
  using enum regression::DeviceUnderTest::Kind;
  if (prepared.what->device.kind == kProgram || prepared.what->device.kind == kAttached) return;
  RecordedServer server(prepared, folder, {});
  {
    const auto axis = open_axis({.address = server.link(), .token = {}}, prepared.what->device.axis, "test");
    drive(*axis, *prepared.what, [] {}, {.end_tick = prepared.facts.end_tick, .repeats = repeats});
  }
  server.end();
}

}  // namespace drivebench::command
