#include <fmt/core.h>
#include <time.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <thread>

#include "clients/command/common/programs/installation.hpp"
#include "clients/command/common/programs/process.hpp"
#include "protocols/modbus/register_map.hpp"
#include "tests/benchmark/crowd/abusers.hpp"
#include "tests/benchmark/exchange/plain_modbus.hpp"
#include "tests/benchmark/harness/canary.hpp"
#include "tests/benchmark/harness/plan.hpp"
#include "tests/benchmark/harness/server.hpp"
#include "tests/benchmark/harness/statistics.hpp"
#include "tests/benchmark/measurements.hpp"

namespace drivebench::speed::abuse {
namespace {

using namespace std::chrono_literals;

constexpr double kMaxP99_ms = 5.0;
constexpr double kMaxWorst_ms = 20.0;
constexpr std::int64_t kDuration_ns = 5'000'000'000;
constexpr std::int64_t kBrief_ns = 200'000'000;
constexpr std::int64_t kScan_ns = 30'000'000'000;  // at most: nmap waits 5 s before its first probe
constexpr std::int64_t kReadEvery_ns = 5'000'000;
constexpr const char* kNmap = "/usr/bin/nmap";

enum class Abuse { kNone, kFlood, kDrip, kScan };
struct Kind {
  Abuse abuse;
  const char* name;
};
constexpr auto kAbuses = std::to_array<Kind>({{Abuse::kFlood, "illegal functions"},
                                              {Abuse::kDrip, "100 dripping connections"},
                                              {Abuse::kScan, "nmap -sV"}});

/// Runs the abuser until this object goes.
class Abuser {
 public:
  Abuser(Abuse abuse, std::uint16_t port) {
    if (abuse == Abuse::kFlood) child_.emplace([port] { flood_with_illegal_functions(port); });
    if (abuse == Abuse::kDrip) child_.emplace([port] { drip(port); });
    if (abuse == Abuse::kScan) {
      scan_.emplace(
          std::vector<std::string>{kNmap, "-n", "-Pn", "-sV", "-p", std::to_string(port), "127.0.0.1"});
    }
  }

  /// A scan that ends in time; the other abusers never end.
  bool has_ended() { return scan_ && scan_->wait(command::Process::in(0ms)).has_value(); }

 private:
  std::optional<Child> child_;
  std::optional<command::Process> scan_;
};

/// Answer times of a client that reads the process data 200 times a second.
struct Seen {
  double p99_ms = 0.0;
  double worst_ms = 0.0;
  std::size_t reads = 0;
  bool gave_up = false;  ///< the last read was not answered, or its connection cut

  std::string text() const {
    return fmt::format("p99 {:.2f} ms, worst {:.0f} ms{} of {}", p99_ms, worst_ms,
                       gave_up ? " (then no answer)" : "", reads);
  }
};

Seen read_beside(Abuse abuse, std::uint16_t port) {
  const ModbusContext client = connect_modbus(port);
  Abuser abuser(abuse, port);
  std::vector<double> ms;
  std::array<std::uint16_t, 13> words{};
  Seen seen;
  const std::int64_t end = now_ns() + planned(abuse == Abuse::kScan ? kScan_ns : kDuration_ns, kBrief_ns);
  for (std::int64_t due = now_ns(); due < end && !seen.gave_up && !abuser.has_ended();) {
    const std::int64_t begin = now_ns();
    seen.gave_up =
        ::modbus_read_registers(client.get(), modbus::kProcessStart, words.size(), words.data()) < 0;
    ms.push_back(static_cast<double>(now_ns() - begin) * 1e-6);
    // The next read is due 5 ms after this one was; reads that the server delayed are not made up for.
    due = std::max(due + kReadEvery_ns, now_ns());
    const timespec at{.tv_sec = due / 1'000'000'000, .tv_nsec = due % 1'000'000'000};
    ::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, nullptr);
  }
  seen.reads = ms.size();
  seen.p99_ms = percentile(ms, 0.99);
  seen.worst_ms = *std::max_element(ms.begin(), ms.end());
  return seen;
}

struct RealtimeRun {
  Seen seen;
  double ticks = 0.0;
  double late_ticks = 0.0;
  Disturbance disturbance;
};

RealtimeRun beside_bench(Abuse abuse, const std::filesystem::path& bench) {
  // Before and after, since the bench itself takes its time.
  Canary canary;
  const CpuPair cpu = cpu_pair();
  canary.look(std::array{cpu.near, cpu.far});
  Server server({bench.string(), "--mode", "realtime"});
  RealtimeRun run;
  run.seen = read_beside(abuse, server.modbus_port());
  const nlohmann::json verdict = server.stop();
  run.ticks = verdict.at("ticks").get<double>();
  run.late_ticks = verdict.at("late_ticks").get<double>();
  canary.look(std::array{cpu.near, cpu.far});
  run.disturbance = canary.seen();
  return run;
}

}  // namespace

std::vector<Row> measure() {
  const ScratchFolder folder;
  BenchConfig config = load_config(command::find_config("servo-modbus"));
  config.modbus.port = 0;
  const std::filesystem::path bench = folder / "bench.toml";
  if (!(std::ofstream(bench) << to_toml(config))) throw std::runtime_error("cannot write " + bench.string());

  const RealtimeRun quiet = beside_bench(Abuse::kNone, bench);
  const double quiet_share = quiet.late_ticks / quiet.ticks;
  std::vector<Row> rows;
  Row late{.name = "late ticks beside abuse", .floor = 0.0, .note = "floor: as many ticks of a quiet run"};
  for (const Kind& kind : kAbuses) {
    const std::string beside = std::string(", ") + kind.name;
    if (kind.abuse == Abuse::kScan && !std::filesystem::exists(kNmap)) {
      rows.push_back({.name = "polite client" + beside, .note = "nmap is not installed", .skipped = true});
      continue;
    }
    const RealtimeRun run = beside_bench(kind.abuse, bench);
    const PlainModbusServer plain_server;
    const Seen plain = read_beside(kind.abuse, plain_server.port());
    rows.push_back({.name = "p99" + beside,
                    .unit = "ms",
                    .measured = run.seen.p99_ms,
                    .limit = Limit{Limit::Kind::kAtMost, kMaxP99_ms},
                    .disturbance = run.disturbance,
                    .note = fmt::format("of {} reads; quiet {:.2f} ms", run.seen.reads, quiet.seen.p99_ms)});
    rows.push_back(
        {.name = "worst" + beside,
         .unit = "ms",
         .measured = run.seen.worst_ms,
         .limit = Limit{Limit::Kind::kAtMost, kMaxWorst_ms},
         .disturbance = run.disturbance,
         .note = fmt::format("quiet {:.2f} ms; plain libmodbus: {}", quiet.seen.worst_ms, plain.text())});
    if (run.seen.gave_up)
      throw std::runtime_error("a polite client got no answer beside " + std::string(kind.name));
    late.measured += run.late_ticks;
    *late.floor += quiet_share * run.ticks;
    late.disturbance.gone = std::max(late.disturbance.gone, run.disturbance.gone);
    late.disturbance.slowed = std::max(late.disturbance.slowed, run.disturbance.slowed);
    late.note += fmt::format("; {}: {:.0f} of {:.0f}", kind.name, run.late_ticks, run.ticks);
  }
  late.note += fmt::format("; quiet: {:.0f} of {:.0f}", quiet.late_ticks, quiet.ticks);
  rows.push_back(std::move(late));
  return rows;
}

}  // namespace drivebench::speed::abuse
