#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <memory>
#include <optional>
#include <sstream>
#include <thread>

#include "clients/command/common/programs/composed_file.hpp"
#include "clients/command/common/programs/installation.hpp"
#include "clients/command/common/programs/process.hpp"
#include "clients/command/common/programs/server_ready.hpp"
#include "clients/command/common/session/session.hpp"
#include "clients/command/recording/recorded_samples.hpp"
#include "clients/command/regression/cases/run_case.hpp"
#include "clients/command/regression/cases/server_answers.hpp"
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

constexpr auto kServerStart = 20s;
constexpr auto kServerEnd = 20s;
constexpr auto kPoll = 2ms;
/// The device under test may end by itself for so long, once its bench is gone.
constexpr auto kFarewell = 2s;
constexpr std::size_t kMostOutput = 65'536;

/// The end of what a program wrote.
std::string tail_of(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  std::string all = text.str();
  if (all.size() > kMostOutput) all.erase(0, all.size() - kMostOutput);
  return all;
}

/// The output without the address of this run, so that equal runs give equal reports.
std::string without_place(std::string text, const std::string& link) {
  for (std::size_t at = text.find(link); at != std::string::npos; at = text.find(link, at))
    text.replace(at, link.size(), "DRIVEBENCH_LINK");
  return text;
}

constexpr const char* kOutput = "output.txt";

constexpr const char* kSocket = "bench.sock";

/// A server on the bench of the case. Equal runs have equal recordings: it runs in the folder of the case and
/// knows its socket by a name without a folder, which the recording tells; and in lockstep time stands still
/// from the last tick on, however late the runner sees that.
class RecordedServer {
 public:
  RecordedServer(const PreparedCase& prepared, const fs::path& folder, const RunWishes& wishes)
      : socket_(fs::absolute(folder / kSocket)),
        recording_(fs::absolute(recording_in(folder))),
        log_(fs::absolute(folder / "server.log")),
        process_(line_of(prepared, wishes),
                 {.folder = fs::absolute(folder).string(), .error_file = log_.string()}) {
    // A server that repeats a run is ready only after that.
    const std::chrono::milliseconds patience =
        wishes.repeats ? kRepetitionPatience : std::chrono::milliseconds(kServerStart);
    const auto ready = await_answer(process_, patience, parse_ready);
    if (!ready) throw std::runtime_error("the server did not start: " + tail_of(log_));
    ready_ = *ready;
  }

  /// The address for a controller of the axis with this number.
  std::string link(regression::DeviceUnderTest::Link way = regression::DeviceUnderTest::Link::kUnix,
                   std::size_t axis = 0) const {
    switch (way) {
      using enum regression::DeviceUnderTest::Link;
      case kTcp:
        return "tcp:" + ready_.tcp;
      case kSharedMemory:
        return "shm:" + socket_.string();
      case kCan:
        return fmt::format("can:{}?fd=1&node={}", ready_.can.at(0), axis + 1);
      case kModbus:
        return fmt::format("modbus:{}?unit={}", ready_.modbus, axis + 1);
      case kUnix:
        break;
    }
    return "unix:" + socket_.string();
  }
  /// Returns when the commands for each axis came; nothing if that was not measured.
  std::vector<AnswerTimes> end() {
    process_.terminate();
    auto answers = process_.await(Process::in(kServerEnd), parse_answers);
    if (!process_.wait(Process::in(kServerEnd))) throw std::runtime_error("the server did not end");
    return std::move(answers).value_or(std::vector<AnswerTimes>());
  }

 private:
  std::vector<std::string> line_of(const PreparedCase& prepared, const RunWishes& wishes) const {
    std::vector<std::string> line{server_executable().string(),
                                  fs::absolute(prepared.bench_file).string(),
                                  "--json",
                                  "--port",
                                  "0",
                                  "--unix",
                                  kSocket,
                                  "--record",
                                  recording_.string()};
    const bool ends_in_lockstep =
        !prepared.what->is_realtime && prepared.facts.end_tick != RunFacts{}.end_tick;
    if (ends_in_lockstep) {
      line.emplace_back("--duration");
      line.push_back(fmt::to_string(static_cast<double>(prepared.facts.end_tick) * prepared.facts.period_s));
    }
    if (wishes.timing) line.emplace_back("--measure-answers");
    if (wishes.repeats) {
      line.insert(line.end(), {"--repeat", fs::absolute(wishes.repeats->recording).string(), "--until",
                               fmt::to_string(wishes.repeats->until)});
    }
    return line;
  }

  fs::path socket_;
  fs::path recording_;
  fs::path log_;
  Process process_;
  ServerReady ready_{};
};

/// Asks a bench for its newest tick while the device under test drives it.
class TickView {
 public:
  explicit TickView(const std::string& address)
      : link_(address, {.client = "drivebench test", .token = {}}) {}
  std::uint64_t tick() { return link_.exchange({}).front().sample.tick; }

 private:
  link::Link link_;
};

/// Waits until the bench has come to the end of the case, or the program has ended. Returns the reason why
/// the run is none; empty: it is one.
std::string await_end(Process& program, TickView& bench, const Case& c, const RunFacts& facts) {
  const auto deadline = Process::in(std::chrono::milliseconds(std::llround(c.device.time_limit_s * 1e3)));
  const auto at = [&](std::uint64_t tick) { return static_cast<double>(tick) * facts.period_s; };
  for (;;) {
    const std::optional<int> code =
        program.wait(Process::in(0ms));  // before the tick: it may end with the last one
    const std::uint64_t tick = bench.tick();
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

/// Shows the samples of a recording, a tick at a time.
template <class See>
void show_recording(const fs::path& file, const RunFacts& facts, See see) {
  RecordedSamples recorded(file, facts.axes);
  std::vector<Sample> samples(facts.axes.size());
  while (const auto row = recorded.next()) {
    end_if_interrupted();
    samples[row->axis] = row->sample;
    if (row->axis + 1 == samples.size()) see(samples);  // a tick brings the axes in their order
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
  std::vector<AnswerTimes> answers;
  std::string output;
};

/// Runs the device under test beside a server of its own, which leaves its recording in the folder.
ProgramEnd run_beside_server(const PreparedCase& prepared, const fs::path& folder, const RunWishes& wishes) {
  const Case& c = *prepared.what;
  const fs::path output = folder / kOutput;
  RecordedServer server(prepared, folder, wishes);
  TickView bench(server.link());
  const std::string link = server.link(c.device.link, find_axis(prepared.facts, c.device.axis));
  Process program(c.device.command, {.environment = {"DRIVEBENCH_LINK=" + link},
                                     .folder = fs::absolute(c.file).parent_path().string(),
                                     .error_file = output.string(),
                                     .joins_output = true,
                                     .own_group = true});
  ProgramEnd end{
      .failure = await_end(program, bench, c, prepared.facts), .answers = server.end(), .output = {}};
  if (!program.wait(Process::in(end.failure.empty() ? kFarewell : 0s))) program.terminate();
  program.wait(Process::in(kFarewell));
  end.output = utf8(without_place(tail_of(output), link));
  return end;
}

/// The signals of the checks in the recording in a folder.
regression::Trace traced(const PreparedCase& prepared, const fs::path& folder) {
  Judge judge(*prepared.what, prepared.facts, true);
  show_recording(recording_in(folder), prepared.facts,
                 [&](const std::vector<Sample>& samples) { judge.see(samples); });
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
  show_recording(recording_in(folder), prepared.facts, [&](const std::vector<Sample>& samples) {
    judge.see(samples);
    if (samples[place].tick > judge.end_tick()) return;
    missed.see(samples[place]);
    run.see(samples[place]);
  });
  CaseResult result = end.failure.empty() ? judge.result() : judge.failure(Verdict::kError, end.failure);
  result.output = end.output;
  if (place >= end.answers.size()) return result;
  using enum regression::DeviceTiming::Way;
  const auto timing = std::make_shared<regression::DeviceTiming>(
      regression::DeviceTiming{.way = c.is_realtime ? kRealtime : kLockstep,
                               .period_ns = std::llround(prepared.facts.period_s * 1e9),
                               .answers = end.answers[place],
                               .missed = missed});
  const bool came_late = timing->answers.late != 0 || missed.all != 0;
  if (c.is_realtime && came_late && run.was_leased && end.failure.empty())
    timing->effect = effect_of_missed(prepared, folder, run);
  result.timing = timing;
  return result;
}

fs::path recording_in(const fs::path& folder) {
  return folder / "run.mcap";
}

void record_case(const PreparedCase& prepared, const fs::path& folder,
                 const std::optional<RepeatedPart>& repeats) {
  if (prepared.what->device.kind == regression::DeviceUnderTest::Kind::kProgram) return;
  RecordedServer server(prepared, folder, {});
  {
    const auto axis = open_axis({.address = server.link(), .token = {}}, prepared.what->device.axis, "test");
    drive(*axis, *prepared.what, [] {}, {.end_tick = prepared.facts.end_tick, .repeats = repeats});
  }
  server.end();
}

}  // namespace drivebench::command
