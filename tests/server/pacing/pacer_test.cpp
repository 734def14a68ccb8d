#include "server/pacing/pacer.hpp"

#include <gtest/gtest.h>

#include <ctime>
#include <string>
#include <thread>

namespace drivebench::pacer_test {
namespace {

constexpr std::int64_t kPeriodNs = 200'000;

std::int64_t now_ns() {
  timespec t{};
  clock_gettime(CLOCK_MONOTONIC, &t);
  return t.tv_sec * 1'000'000'000 + t.tv_nsec;
}

void stall(std::int64_t duration_ns) {
  const std::int64_t end = now_ns() + duration_ns;
  while (now_ns() < end) {
  }
}

/// The two times between which the tick of one call of wait() was due. They hold whatever else the machine
/// does, so that no test here measures its speed.
struct Due {
  std::int64_t from_ns;
  std::int64_t to_ns;
  std::int64_t lateness_ns;
};

Due wait(Pacer& pacer) {
  const std::int64_t before = now_ns();
  const std::int64_t lateness = pacer.wait();
  const std::int64_t after = now_ns();
  EXPECT_GE(lateness, 0) << "a tick never starts before its time";
  return {before - lateness, after - lateness, lateness};
}

/// Whether the two observations can be of ticks that are `ticks` periods apart.
bool apart(const Due& first, const Due& later, std::int64_t ticks) {
  return later.to_ns - first.from_ns >= ticks * kPeriodNs && later.from_ns - first.to_ns <= ticks * kPeriodNs;
}

class RealtimePacer : public testing::TestWithParam<PacerKind> {
 protected:
  std::unique_ptr<Pacer> pacer_ = make_realtime_pacer(GetParam(), kPeriodNs);
};

INSTANTIATE_TEST_SUITE_P(Both, RealtimePacer, testing::Values(PacerKind::kSleep, PacerKind::kSleepSpin),
                         [](const auto& kind) {
                           return kind.param == PacerKind::kSleep ? std::string("Sleep")
                                                                  : std::string("SleepSpin");
                         });

// Catches: deadlines relative to the last wake-up, which drift.
TEST_P(RealtimePacer, TicksAreDueAtMultiplesOfThePeriod) {
  const Due first = wait(*pacer_);
  for (std::int64_t tick = 1; tick <= 100; ++tick) {
    stall(kPeriodNs / 4);
    EXPECT_TRUE(apart(first, wait(*pacer_), tick)) << tick;
  }
}

// Catches: a tick that starts early when the call comes shortly before its time; wait() of this file asks.
TEST_P(RealtimePacer, ShortlyBeforeItsTimeATickIsStillWaitedFor) {
  wait(*pacer_);
  for (int tick = 0; tick < 100; ++tick) {
    stall(kPeriodNs * 92 / 100);
    wait(*pacer_);
  }
}

// Catches: late ticks that are skipped, or an afterwards that is shifted by the delay.
TEST_P(RealtimePacer, OS_05_LateTicksAreCaughtUpOneByOne) {
  const Due first = wait(*pacer_);
  stall(20 * kPeriodNs);
  for (std::int64_t tick = 1; tick <= 40; ++tick) {
    const Due due = wait(*pacer_);
    EXPECT_TRUE(apart(first, due, tick)) << tick;
    // Tick n is due n periods after the first and starts 20 periods after it at the earliest.
    if (tick < 20) {
      EXPECT_GE(due.lateness_ns, (20 - tick) * kPeriodNs - (first.to_ns - first.from_ns)) << tick;
    }
  }
}

// Catches: a pacer that goes on catching up after the bench has given the lost time up.
TEST_P(RealtimePacer, ResynchroniseMakesTheTickThatIsDueTheNewZero) {
  wait(*pacer_);
  stall(20 * kPeriodNs);
  EXPECT_GE(wait(*pacer_).lateness_ns, 18 * kPeriodNs);
  const std::int64_t before = now_ns();
  pacer_->resynchronise();
  const Due zero{before, now_ns(), 0};
  for (std::int64_t tick = 1; tick <= 10; ++tick)
    EXPECT_TRUE(apart(zero, wait(*pacer_), tick)) << tick;
}

std::int64_t unix_now_ns() {
  timespec t{};
  clock_gettime(CLOCK_REALTIME, &t);
  return t.tv_sec * 1'000'000'000 + t.tv_nsec;
}

// Catches: a wall time of the call and not of the due time, of another clock, or one that resynchronise()
// forgets. Holds while no program sets the clock.
TEST_P(RealtimePacer, TheDueTimeIsKnownByTheWallClock) {
  EXPECT_EQ(pacer_->due_unix_ns(), 0);
  const std::int64_t before = unix_now_ns();
  wait(*pacer_);
  EXPECT_GE(pacer_->due_unix_ns(), before);
  EXPECT_LE(pacer_->due_unix_ns(), unix_now_ns());
  const std::int64_t first = pacer_->due_unix_ns();
  stall(20 * kPeriodNs);
  wait(*pacer_);
  EXPECT_EQ(pacer_->due_unix_ns(), first + kPeriodNs);
  const std::int64_t standstill_over = unix_now_ns();
  pacer_->resynchronise();
  EXPECT_GE(pacer_->due_unix_ns(), standstill_over);
}

// Catches: a free run that takes wall time.
TEST(FreePacer, IsNeverLate) {
  const auto pacer = make_free_pacer();
  for (int n = 0; n < 10; ++n) {
    EXPECT_EQ(pacer->wait(), 0);
    pacer->resynchronise();
  }
}

// Catches: a refusal of the operating system that no note tells of.
TEST(EnterRealtime, OS_07_ReportsRightsThatWereNotGranted) {
  std::vector<std::string> notes;
  std::thread([&notes] { notes = enter_realtime({.cpu = 1023, .priority = 1000}); }).join();
  const auto said = [&notes](const std::string& text) {
    for (const std::string& note : notes) {
      if (note.find(text) != std::string::npos) return true;
    }
    return false;
  };
  EXPECT_TRUE(said("SCHED_FIFO 1000"));
  EXPECT_TRUE(said("CPU 1023"));
}

}  // namespace
}  // namespace drivebench::pacer_test
