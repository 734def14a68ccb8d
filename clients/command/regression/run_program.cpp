#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <memory>
#include <optional>
#include <sstream>
#include <thread>

#include "clients/command/common/programs/installation.hpp"
#include "clients/command/common/programs/process.hpp"
#include "clients/command/common/programs/server_ready.hpp"
#include "clients/command/common/session/session.hpp"
#include "clients/command/recording/recorded_samples.hpp"
#include "clients/command/regression/run_case.hpp"
#include "clients/command/regression/server_answers.hpp"
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
    if (!process_.await(Process::in(kServerStart), parse_ready)) {
      throw std::runtime_error("the server did not start: " + tail_of(log_));
    }
  }

  std::string link() const { return "unix:" + socket_.string(); }
  const fs::path& recording() const noexcept { return recording_; }
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
    samples[row->axis] = row->sample;
    if (row->axis + 1 == samples.size()) see(samples);  // a tick brings the axes in their order
  }
}

}  // namespace

CaseResult run_program_case(const PreparedCase& prepared, const fs::path& folder, const RunWishes& wishes,
                            Judge& judge) {
  const Case& c = *prepared.what;
  const fs::path output = folder / kOutput;
  RecordedServer server(prepared, folder, wishes);
  TickView bench(server.link());
  Process program(c.device.command, {.environment = {"DRIVEBENCH_LINK=" + server.link()},
                                     .folder = fs::absolute(fs::path(c.file).parent_path()).string(),
                                     .error_file = output.string(),
                                     .joins_output = true,
                                     .own_group = true});
  const std::string failure = await_end(program, bench, c, prepared.facts);
  const std::vector<AnswerTimes> answers = server.end();
  if (!program.wait(Process::in(failure.empty() ? kFarewell : 0s))) program.terminate();
  program.wait(Process::in(kFarewell));
  const std::size_t place = find_axis(prepared.facts, c.device.axis);
  regression::MissedTicks missed;
  show_recording(server.recording(), prepared.facts, [&](const std::vector<Sample>& samples) {
    judge.see(samples);
    if (samples[place].tick <= judge.end_tick()) missed.see(samples[place]);
  });
  CaseResult result = failure.empty() ? judge.result() : judge.failure(Verdict::kError, failure);
  result.output = utf8(without_place(tail_of(output), server.link()));
  if (place < answers.size()) {
    using enum regression::DeviceTiming::Way;
    result.timing = std::make_shared<regression::DeviceTiming>(
        regression::DeviceTiming{.way = c.is_realtime ? kRealtime : kLockstep,
                                 .period_ns = std::llround(prepared.facts.period_s * 1e9),
                                 .answers = answers[place],
                                 .missed = missed});
  }
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
