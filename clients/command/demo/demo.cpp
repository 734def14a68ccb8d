#include "clients/command/demo/demo.hpp"

#include <fmt/core.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/programs/installation.hpp"
#include "clients/command/common/programs/process.hpp"
#include "clients/command/common/programs/server_ready.hpp"
#include "clients/command/control/control_json.hpp"
#include "clients/command/demo/demo_json.hpp"

namespace drivebench::command {
namespace fs = std::filesystem;
namespace {

using namespace std::chrono_literals;

constexpr double kPromisedErrorCounts = 2.0;

/// Local time, so that recordings of several demos stand side by side in order, and the process, so that no
/// two demos want the same file.
std::string time_stamp() {
  const std::time_t now = std::time(nullptr);
  std::tm local = {};
  ::localtime_r(&now, &local);
  std::string text(32, '\0');
  text.resize(std::strftime(text.data(), text.size(), "%Y%m%d-%H%M%S", &local));
  return fmt::format("{}-{}", text, ::getpid());
}

/// Runs the controller as a process of its own against the server at this address.
void control(const std::string& address, DemoRun& run) {
  Process controller({own_executable().string(), "control", "--json", "--link", address});
  const auto report = controller.await(Process::in(60s), parse_control);
  const std::optional<int> exit_code = controller.wait(Process::in(5s));
  if (report) run.control = *report;
  if (!report) {
    run.failure = "the controller gave no report";
  } else if (!report->failure.empty()) {
    run.failure = report->failure;
  } else if (exit_code != 0) {
    run.failure = exit_code ? fmt::format("the controller ended with code {}", *exit_code)
                            : "the controller does not end";
  }
}

/// Starts a server on a free port, makes one move, and takes the server's verdict.
DemoRun run_mode(const std::string& mode, int command_delay_ticks, const fs::path& recording) {
  DemoRun run;
  run.recording = recording.string();
  Process server({server_executable().string(), find_config("servo").string(), "--mode", mode, "--port", "0",
                  "--command-delay-ticks", std::to_string(command_delay_ticks), "--record", run.recording,
                  "--json"});
  const auto ready = server.await(Process::in(15s), parse_ready);
  if (!ready) {
    run.failure = "the server did not start";
    return run;
  }
  control(ready->tcp, run);
  server.terminate();
  const auto verdict = server.await(Process::in(15s), parse_verdict);
  const std::optional<int> exit_code = server.wait(Process::in(5s));
  if (verdict) run.verdict = *verdict;
  if (run.failure.empty() && !verdict) run.failure = "the server gave no verdict";
  if (run.failure.empty() && exit_code != 0) run.failure = "the server did not end well";
  return run;
}

/// Real time needs this machine to run the controller within the watchdog's 20 ticks, 2.5 ms; a busy machine
/// may not, so it gets three chances, each recorded.
DemoRun run_realtime(const fs::path& folder, const std::string& stamp) {
  constexpr int kChances = 3;
  DemoRun run;
  for (int attempt = 1; attempt <= kChances; ++attempt) {
    const std::string number = attempt == 1 ? "" : fmt::format("-{}", attempt);
    run = run_mode("realtime", 1, folder / fmt::format("demo-{}-realtime{}.mcap", stamp, number));
    run.attempts = attempt;
    if (run.failure.empty()) break;
    fmt::print(stderr, "demo: real time, attempt {} of {}: {}\n", attempt, kChances, run.failure);
  }
  return run;
}

DemoReplay replay(const std::string& recording) {
  Process server({server_executable().string(), "--replay", recording, "--json"});
  const auto report = server.await(Process::in(60s), parse_replay);
  const std::optional<int> exit_code = server.wait(Process::in(5s));
  DemoReplay replay = report.value_or(DemoReplay{});
  if (!report) replay.problem = "the replay gave no report";
  if (exit_code != 0) replay.equal = false;
  return replay;
}

bool keeps_promise(const DemoReport& report) {
  return report.lockstep.failure.empty() && report.realtime.failure.empty() && report.replay.equal &&
         report.lockstep.control.peak_error_counts.value_or(HUGE_VAL) <= kPromisedErrorCounts;
}

/// The program with all verbs: beside drivebench-demo, which has two of them.
fs::path whole_program() {
  return own_executable().parent_path() / "drivebench";
}

/// The same as it can be typed here.
std::string program() {
  const std::string whole = whole_program().string();
  std::error_code ignored;
  const fs::path relative = fs::relative(whole, ignored);
  return relative.empty() ? whole : relative.string();
}

void print_comparison(const DemoReport& r) {
  const ControlReport& a = r.lockstep.control;
  const ControlReport& b = r.realtime.control;
  const auto row = [](std::string_view name, const std::string& left, const std::string& right) {
    fmt::print("  {:<30}{:>18}{:>18}\n", name, left, right);
  };
  const auto shown = [](const DemoRun& run, std::string_view format, double value) {
    return run.failure.empty() ? fmt::format(fmt::runtime(format), value) : std::string("failed");
  };
  const auto numbers = [&](std::string_view name, std::string_view format, double left, double right) {
    row(name, shown(r.lockstep, format, left), shown(r.realtime, format, right));
  };
  fmt::print("180 degree move of an induction servo, {} ({})\n\n", a.preset, a.bench);
  row("", "lockstep", "real time");
  numbers("peak error [counts]", "{:.2f}", a.peak_error_counts.value_or(0.0),
          b.peak_error_counts.value_or(0.0));
  numbers("final error [counts]", "{:.2f}", a.final_error_counts.value_or(0.0),
          b.final_error_counts.value_or(0.0));
  numbers("duration [ms of bench time]", "{:.1f}", a.duration_s * 1e3, b.duration_s * 1e3);
  numbers("wall time [ms]", "{:.1f}", a.wall_s * 1e3, b.wall_s * 1e3);
  numbers("peak phase current [A]", "{:.2f}", a.peak_current_a, b.peak_current_a);
  numbers("peak phase voltage [V]", "{:.1f}", a.peak_voltage_v.value_or(0.0), b.peak_voltage_v.value_or(0.0));
  numbers("samples", "{:.0f}", static_cast<double>(a.samples), static_cast<double>(b.samples));
  numbers("samples missed by controller", "{:.0f}", static_cast<double>(a.missed_ticks),
          static_cast<double>(b.missed_ticks));
  numbers("late ticks", "{:.0f}", static_cast<double>(r.lockstep.verdict.late_ticks),
          static_cast<double>(r.realtime.verdict.late_ticks));
  numbers("exchange p50 [us]", "{:.1f}", a.exchange_p50_us, b.exchange_p50_us);
  numbers("exchange p99 [us]", "{:.1f}", a.exchange_p99_us, b.exchange_p99_us);
  row("state hash", r.lockstep.verdict.state_hash, r.realtime.verdict.state_hash);
  fmt::print("\n  In real time the bench does not wait: an exchange lasts until the next tick.\n");
  if (b.missed_ticks > 0) {
    fmt::print(
        "  The controller, an ordinary process, was woken too late for {} samples and went on with the next\n"
        "  one{} the errors above show what it cost.\n",
        b.missed_ticks, r.realtime.verdict.late_ticks == 0 ? ": nothing is wrong, and" : ";");
  }
  if (r.realtime.verdict.late_ticks > 0 || !r.realtime.failure.empty()) {
    fmt::print(
        "  This machine was too busy for real time: the bench began {} ticks late. Lockstep does not mind.\n"
        "  Run it again when less else runs; `{} doctor` tells what helps.\n",
        r.realtime.verdict.late_ticks, program());
  }
  fmt::print("\n");
  for (const DemoRun* run : {&r.lockstep, &r.realtime}) {
    fmt::print("{}\n  recorded in {}\n", run->verdict.sentence, run->recording);
    if (!run->failure.empty()) fmt::print("  FAILED: {}\n", run->failure);
  }
  if (r.replay.equal) {
    fmt::print("replay of the lockstep recording: equal, bit for bit ({} ticks, {} samples)\n",
               r.replay.ticks, r.replay.samples);
  } else {
    fmt::print("replay of the lockstep recording: FAILED: {}\n", r.replay.problem);
  }
}

void print_next_steps(const DemoReport& r) {
  const std::string self = program();
  fmt::print("\nwhat to try next:\n");
  if (own_executable() != whole_program())
    fmt::print("  ./bench tools    builds the program with all verbs, and the library; then\n");
  fmt::print("  {} export {} --out move.csv\n", self, r.lockstep.recording);
  fmt::print("  {} serve            and in another terminal\n", self);
  fmt::print("  {} control --load 0.1@0.0365 --set machine.rotor_resistance_ohm=5.85\n", self);
  fmt::print("  {} control --preset book/8.2.2-clipped      the book's trap: 7 counts\n", self);
  fmt::print("  {} new motor --help    your own motor, from its data sheet\n", self);
}

}  // namespace

int run_demo(const DemoOptions& options) {
  const fs::path folder = options.folder;
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw UsageError(fmt::format("cannot make the folder {}: {}", options.folder, error.message()));
  const std::string stamp = time_stamp();

  DemoReport report;
  fmt::print(stderr, "demo: the move in lockstep\n");
  report.lockstep = run_mode("lockstep", 0, folder / fmt::format("demo-{}-lockstep.mcap", stamp));
  fmt::print(stderr, "demo: the move in real time\n");
  report.realtime = run_realtime(folder, stamp);
  fmt::print(stderr, "demo: replaying the lockstep recording\n");
  report.replay = replay(report.lockstep.recording);

  if (options.json) {
    fmt::print("{}\n", demo_json(report));
  } else {
    print_comparison(report);
    print_next_steps(report);
  }
  return keeps_promise(report) ? kExitOk : kExitFailed;
}

}  // namespace drivebench::command
