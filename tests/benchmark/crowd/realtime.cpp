#include <fmt/core.h>
#include <sys/mman.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <ctime>
#include <thread>

#include "clients/command/common/programs/installation.hpp"
#include "server/pacing/pacer.hpp"
#include "tests/benchmark/harness/canary.hpp"
#include "tests/benchmark/harness/machine.hpp"
#include "tests/benchmark/harness/plan.hpp"
#include "tests/benchmark/harness/server.hpp"
#include "tests/benchmark/harness/statistics.hpp"
#include "tests/benchmark/measurements.hpp"

namespace drivebench::speed::realtime {
namespace {

constexpr double kMaxP99Ratio = 1.3;
constexpr std::int64_t kPeriodNs = 125'000;
constexpr std::size_t kTicksPerBlock = 1000;  // short, so that all loops see the same machine
constexpr std::size_t kRounds = 20;

/// The floor: the plain loop, with the kernel's timer and nothing else.
class BarePacer final : public Pacer {
 public:
  std::int64_t wait() noexcept override {
    if (due_ns_ == 0) due_ns_ = now_ns() - kPeriodNs;
    due_ns_ += kPeriodNs;
    const timespec due{.tv_sec = due_ns_ / 1'000'000'000, .tv_nsec = due_ns_ % 1'000'000'000};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, nullptr) == EINTR) {
    }
    return now_ns() - due_ns_;
  }
  void resynchronise() noexcept override { due_ns_ = now_ns(); }

 private:
  std::int64_t due_ns_ = 0;
};

struct Lateness {
  Percentiles us;
  double late_share;  ///< of ticks that started after the end of their period
};

Lateness lateness(Pacer& pacer) {
  std::vector<double> us(kTicksPerBlock);
  pacer.wait();
  for (double& each : us)
    each = static_cast<double>(pacer.wait()) * 1e-3;
  const auto late = std::count_if(us.begin(), us.end(), [](double each) { return each * 1e3 >= kPeriodNs; });
  return {.us = percentiles(us),
          .late_share = static_cast<double>(late) / static_cast<double>(kTicksPerBlock)};
}

struct Round {
  Lateness bare, sleep, sleep_spin;
};

/// Runs this on a thread of its own, prepared like the server's tick; returns what rights are missing.
template <class Work>
std::vector<std::string> in_realtime(Work work) {
  std::vector<std::string> missing;
  std::thread([&] {
    missing = enter_realtime({.cpu = cpu_pair().far});
    work();
  }).join();
  ::munlockall();  // enter_realtime locked the memory of the whole program
  return missing;
}

Rounds<Round> alternate(std::vector<std::string>& notes) {
  Rounds<Round> rounds;
  notes = in_realtime([&rounds] {
    rounds = undisturbed_rounds(std::array{cpu_pair().far}, kRounds, []() -> Round {
      BarePacer bare;
      return {.bare = lateness(bare),
              .sleep = lateness(*make_realtime_pacer(PacerKind::kSleep, kPeriodNs)),
              .sleep_spin = lateness(*make_realtime_pacer(PacerKind::kSleepSpin, kPeriodNs))};
    });
  });
  return rounds;
}

Row row(const char* name, const Rounds<Round>& rounds, Lateness Round::*pacer) {
  const auto p50 = [&](Lateness Round::*each) {
    return median(rounds.results, [each](const Round& round) { return (round.*each).us.p50; });
  };
  const auto p99 = [&](Lateness Round::*each) {
    return median(rounds.results, [each](const Round& round) { return (round.*each).us.p99; });
  };
  return {.name = name,
          .unit = "us",
          .measured = p99(pacer),
          .floor = p99(&Round::bare),
          .limit = Limit{Limit::Kind::kRatioAtMost, kMaxP99Ratio},
          .disturbance = rounds.disturbance,
          .note = fmt::format("p50 {:.2f} us; floor: clock_nanosleep alone, p50 {:.2f} us", p50(pacer),
                              p50(&Round::bare))};
}

/// The plain loop and the server, a second of each in turn, so that both meet the same machine: a stall of
/// the host counts for either.
Row late_ticks_of_server() {
  constexpr std::size_t kBlocks = 8;  // of 1000 ticks: a second
  const int seconds = planned(10, 1);
  const std::array cpus{cpu_pair().near, cpu_pair().far};
  const std::string bench = command::find_config("servo-realtime").string();
  Row row{.name = "late ticks of the server", .floor = 0.0};
  std::int64_t ticks = 0;
  std::vector<double> p99_us;
  double worst_us = 0.0;
  Canary canary;
  canary.look(cpus);
  for (int n = 0; n < seconds; ++n) {
    in_realtime([&row] {
      BarePacer bare;
      for (std::size_t block = 0; block < kBlocks; ++block)
        *row.floor += lateness(bare).late_share * static_cast<double>(kTicksPerBlock);
    });
    const nlohmann::json verdict = Server({bench, "--duration", "1"}).wait(std::chrono::seconds(30));
    row.measured += verdict.at("late_ticks").get<double>();
    ticks += verdict.at("ticks").get<std::int64_t>();
    p99_us.push_back(verdict.at("lateness_p99_us").get<double>());
    worst_us = std::max(worst_us, verdict.at("worst_lateness_us").get<double>());
  }
  canary.look(cpus);
  row.disturbance = canary.seen();
  row.note = fmt::format(
      "of {}, not pinned; floor: clock_nanosleep alone, a second of each in turn; lateness p99 {:.1f} us in "
      "the "
      "median second, worst {:.1f} us",
      ticks, percentile(p99_us, 0.5), worst_us);
  return row;
}

}  // namespace

std::vector<Row> measure() {
  std::vector<std::string> notes;
  const Rounds<Round> rounds = alternate(notes);
  std::vector<Row> rows{row("lateness p99, sleep", rounds, &Round::sleep),
                        row("lateness p99, sleep+spin", rounds, &Round::sleep_spin), late_ticks_of_server()};
  for (const std::string& note : notes)
    rows[0].note += "; " + note;
  return rows;
}

}  // namespace drivebench::speed::realtime
