#include "server/pacing/tick_clock.hpp"

#include <gtest/gtest.h>

#include <cstddef>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "tests/server/recording/run_config.hpp"

namespace drivebench::tick_clock_test {
namespace {

/// Ticks that are so late, one after the other.
class ScriptedPacer final : public Pacer {
 public:
  ScriptedPacer(std::vector<std::int64_t> lateness_ns, int& resynchronised)
      : lateness_ns_(std::move(lateness_ns)), resynchronised_(resynchronised) {}
  std::int64_t wait() noexcept override { return lateness_ns_[next_++]; }
  void resynchronise() noexcept override { ++resynchronised_; }
  std::int64_t due_unix_ns() const noexcept override { return kUnixNs; }

  static constexpr std::int64_t kUnixNs = 1'800'000'000'000'000'000;

 private:
  std::vector<std::int64_t> lateness_ns_;
  int& resynchronised_;
  std::size_t next_ = 0;
};

constexpr std::int64_t kClockPeriodNs = 125'000;
constexpr std::int64_t kMaxLatenessNs = 1'000'000;
const std::vector<std::int64_t> kLatenessesNs = {0, kClockPeriodNs - 1, kClockPeriodNs, kMaxLatenessNs,
                                                 kMaxLatenessNs + 1};

BenchConfig paced_bench() {
  BenchConfig config = servo_bench();
  config.setup.period_ns = kClockPeriodNs;
  config.realtime.max_lateness_ns = kMaxLatenessNs;
  return config;
}

// Catches: a limit that is off by one, an overrun that is only a late tick or the other way round, lost time
// that is caught up after an overrun.
TEST(TickClock, OS_03_TellsTheBenchOfLateTicksAndOverruns) {
  const BenchConfig config = paced_bench();
  Bench bench(config.setup);
  int resynchronised = 0;
  TickClock clock(RunMode::kRealtime, config, std::make_unique<ScriptedPacer>(kLatenessesNs, resynchronised));
  const std::vector<std::uint64_t> late_ticks = {0, 0, 1, 2, 3};
  for (std::size_t i = 0; i < kLatenessesNs.size(); ++i) {
    EXPECT_FALSE(bench.is_latched(0)) << i;
    clock.wait_for_tick();
    clock.report_lateness(bench);
    bench.step();
    EXPECT_EQ(bench.sample(0).late_ticks, late_ticks[i]) << i;
    EXPECT_EQ(clock.shown_lateness().worst_ns, kLatenessesNs[i]) << i;
  }
  EXPECT_EQ(bench.sample(0).faults, kBenchOverrun);
  EXPECT_EQ(resynchronised, 1);
  EXPECT_EQ(clock.lateness().count(), kLatenessesNs.size());
}

// Catches: a wall time of each tick, one that an overrun or a restored state does not renew, one that is a
// period off, or one of a free run.
TEST(TickClock, TellsTheWallTimeWhenItsDueTimesBegin) {
  const BenchConfig config = paced_bench();
  int resynchronised = 0;
  const std::vector<std::int64_t> latenesses = {0, 0, kMaxLatenessNs + 1, 0, 0, 0};
  TickClock clock(RunMode::kRealtime, config, std::make_unique<ScriptedPacer>(latenesses, resynchronised));
  TickClock free(RunMode::kFree, config, std::make_unique<ScriptedPacer>(latenesses, resynchronised));
  for (Tick tick = 0; tick < 6; ++tick) {
    if (tick == 4) clock.begin_anew();
    clock.wait_for_tick();
    free.wait_for_tick();
    EXPECT_EQ(free.new_time_base(tick), std::nullopt);
    const std::optional<TimeBase> base = clock.new_time_base(tick);
    EXPECT_EQ(base.has_value(), tick == 0 || tick == 2 || tick == 4) << tick;
    if (!base) continue;
    EXPECT_EQ(base->since_tick, static_cast<std::uint64_t>(tick));
    EXPECT_EQ(base->unix_ns(static_cast<std::uint64_t>((tick + 1) * kClockPeriodNs)), ScriptedPacer::kUnixNs)
        << "the tick's sample is due with it";
  }
}

// Catches: a free run that depends on the time that it takes.
TEST(TickClock, AFreeRunHasNoLateTicks) {
  const BenchConfig config = paced_bench();
  Bench bench(config.setup);
  int resynchronised = 0;
  TickClock clock(RunMode::kFree, config, std::make_unique<ScriptedPacer>(kLatenessesNs, resynchronised));
  for (std::size_t i = 0; i < kLatenessesNs.size(); ++i) {
    clock.wait_for_tick();
    clock.report_lateness(bench);
    bench.step();
  }
  EXPECT_EQ(bench.sample(0).late_ticks, 0u);
  EXPECT_EQ(bench.sample(0).faults, 0u);
  EXPECT_EQ(resynchronised, 0);
  EXPECT_EQ(clock.lateness().count(), 0u);
}

}  // namespace
}  // namespace drivebench::tick_clock_test
