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
#include "tests/benchmark/harness/server.hpp"
#include "tests/benchmark/harness/statistics.hpp"
#include "tests/benchmark/measurements.hpp"

namespace drivebench::speed {
namespace {

constexpr double kMaxP99Ratio = 1.3;
constexpr std::int64_t kPeriodNs = 125'000;
constexpr std::size_t kTicksPerBlock = 1000;  // short, so that all loops see the same machine
constexpr std::size_t kRounds = 20;
constexpr int kServerSeconds = 5;

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

/// On a thread of its own, prepared like the server's tick; missing rights go to notes.
Rounds<Round> alternate(std::vector<std::string>& notes) {
  Rounds<Round> rounds;
  std::thread([&] {
    const std::array cpu{cpu_pair().far};
    notes = enter_realtime({.cpu = cpu[0]});
    rounds = undisturbed_rounds(cpu, kRounds, []() -> Round {
      BarePacer bare;
      return {.bare = lateness(bare),
              .sleep = lateness(*make_realtime_pacer(PacerKind::kSleep, kPeriodNs)),
              .sleep_spin = lateness(*make_realtime_pacer(PacerKind::kSleepSpin, kPeriodNs))};
    });
  }).join();
  ::munlockall();  // enter_realtime locked the memory of the whole program
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
          .gone = rounds.gone,
          .note = fmt::format("p50 {:.2f} us; floor: clock_nanosleep alone, p50 {:.2f} us", p50(pacer),
                              p50(&Round::bare))};
}

Row late_ticks_of_server(const Rounds<Round>& rounds) {
  double bare_share = 0.0;
  for (const Round& round : rounds.results)
    bare_share += round.bare.late_share / static_cast<double>(rounds.results.size());
  const std::string bench = command::find_config("servo-realtime").string();
  Server server({bench, "--duration", std::to_string(kServerSeconds)});
  const nlohmann::json verdict = server.wait(std::chrono::seconds(10 * kServerSeconds));
  return {.name = "late ticks of the server",
          .measured = verdict.at("late_ticks").get<double>(),
          .floor = bare_share * verdict.at("ticks").get<double>(),
          .gone = rounds.gone,
          .note = fmt::format("of {} in {} s, not pinned; floor: clock_nanosleep alone; lateness p50 {:.1f} "
                              "us, p99 {:.1f} us, worst {:.1f} us",
                              verdict.at("ticks").get<std::int64_t>(), kServerSeconds,
                              verdict.at("lateness_p50_us").get<double>(),
                              verdict.at("lateness_p99_us").get<double>(),
                              verdict.at("worst_lateness_us").get<double>())};
}

}  // namespace

std::vector<Row> measure_realtime(const Plan&) {
  std::vector<std::string> notes;
  const Rounds<Round> rounds = alternate(notes);
  std::vector<Row> rows{row("lateness p99, sleep", rounds, &Round::sleep),
                        row("lateness p99, sleep+spin", rounds, &Round::sleep_spin),
                        late_ticks_of_server(rounds)};
  for (const std::string& note : notes)
    rows[0].note += "; " + note;
  return rows;
}

}  // namespace drivebench::speed
