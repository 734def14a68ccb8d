#include "server/engine/engine.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <cstring>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "server/engine/stepped_engine.hpp"
#include "server/host/asio.hpp"
#include "server/pacing/pacer.hpp"
#include "tests/repetitions.hpp"
#include "tests/server/engine/engine_requests.hpp"
#include "tests/server/recording/run_config.hpp"

namespace drivebench::engine_test {
namespace {

/// The same run without any engine.
struct DirectRun {
  explicit DirectRun(const BenchConfig& config, Tick ticks) : bench(config.setup) {
    schedule_events(config, bench);
    keep();
    while (bench.tick() < ticks) {
      bench.step();
      keep();
    }
  }
  void keep() {
    for (std::size_t axis = 0; axis < bench.axis_count(); ++axis)
      samples.push_back(bench.sample(axis));
  }
  Bench bench;
  std::vector<Sample> samples;
};

BenchConfig free_bench() {
  BenchConfig config = servo_bench(2);
  config.mode = RunMode::kFree;
  config.axes[0].events = {{.tick = 100, .action = LoadChange{.load_nm = 0.2, .ramp_ticks = 50}}};
  config.axes[1].events = {{.tick = 0, .action = LoadChange{.load_nm = -0.1, .ramp_ticks = 0}}};
  return config;
}

// Catches: a thread, a queue or a recorder that changes the run by a bit; an end that comes early, late or
// never.
TEST(ThreadedEngine, DET_01_AFreeRunIsTheDirectRunBitForBit) {
  constexpr Tick kTicks = 5000;
  const BenchConfig config = free_bench();
  const DirectRun direct(config, kTicks);
  for (const bool recorded : {false, true}) {
    const TestFolder folder;
    asio::io_context io(1);
    const auto engine = make_threaded_engine(
        config, recorded ? std::make_unique<Recorder>(folder / "run.mcap", config) : nullptr, io, kTicks);
    int ends = 0;
    std::size_t wrong = 0;
    std::size_t compared = 0;
    engine->on_tick.add([&] {
      for (std::size_t axis = 0; axis < 2; ++axis, ++compared) {
        const Sample& newest = engine->newest(axis);
        const Sample& expected = direct.samples[2 * newest.tick + axis];
        if (std::memcmp(&newest, &expected, sizeof(Sample)) != 0) ++wrong;
      }
    });
    engine->on_end = [&] {
      ++ends;
      io.stop();
    };
    io.run();
    const Verdict verdict = engine->stop();
    EXPECT_EQ(ends, 1);
    EXPECT_EQ(wrong, 0u);
    EXPECT_GT(compared, 0u);
    EXPECT_EQ(verdict.ticks, static_cast<std::uint64_t>(kTicks));
    EXPECT_EQ(verdict.late_ticks, 0u);
    EXPECT_EQ(verdict.gaps, 0u);
    EXPECT_EQ(verdict.state_hash, direct.bench.state_hash());
    EXPECT_TRUE(verdict.exact());
  }
}

// Catches: a result that depends on when threads run. Four others take the CPUs meanwhile.
TEST(ThreadedEngine, DET_01_AHundredRunsBesideOtherWorkAreOneRun) {
  constexpr Tick kTicks = 500;
  const BenchConfig config = free_bench();
  const std::uint64_t expected = DirectRun(config, kTicks).bench.state_hash();
  std::atomic<bool> stop{false};
  std::vector<std::thread> busy;
  for (int i = 0; i < 4; ++i) {
    busy.emplace_back([&stop] {
      while (!stop.load()) {
      }
    });
  }
  std::size_t different = 0;
  for (int run = 0; run < repetitions(100); ++run) {
    asio::io_context io(1);
    const auto engine = make_threaded_engine(config, nullptr, io, kTicks);
    engine->on_end = [&] { io.stop(); };
    io.run();
    if (engine->stop().state_hash != expected) ++different;
  }
  stop.store(true);
  for (std::thread& each : busy)
    each.join();
  EXPECT_EQ(different, 0u);
}

// Catches: answers that are lost, doubled, out of order, or come before the sample of their tick; a request
// without the lease that waits for a tick.
TEST(ThreadedEngine, RequestsAreAnsweredInOrderWithTheirTick) {
  BenchConfig config = servo_bench(2);
  config.mode = RunMode::kFree;
  asio::io_context io(1);
  const auto engine = make_threaded_engine(config, nullptr, io, std::nullopt);
  constexpr int kRequests = 200;
  std::vector<int> answered;
  Tick last = 0;
  for (int n = 0; n < kRequests; ++n) {
    EXPECT_EQ(ask(*engine, lease(LeaseAction::kRenew, 0, kStranger)), Refused::kNotOwner) << n;
    const Input input = lease(n % 2 == 0 ? LeaseAction::kAcquire : LeaseAction::kRelease);
    engine->request(input, [&, n](Refused refused, Tick tick) {
      answered.push_back(n);
      EXPECT_EQ(refused, Refused::kNot) << n;
      EXPECT_GE(tick, last);
      for (std::size_t axis = 0; axis < 2; ++axis) {
        EXPECT_GT(engine->newest(axis).tick, static_cast<std::uint64_t>(tick)) << "the sample that shows it";
      }
      last = tick;
      if (n == kRequests - 1) io.stop();
    });
  }
  io.run();
  engine->stop();
  ASSERT_EQ(answered.size(), static_cast<std::size_t>(kRequests));
  for (int n = 0; n < kRequests; ++n)
    EXPECT_EQ(answered[static_cast<std::size_t>(n)], n);
}

// Catches: two owners of an axis, or none, when one leaves while two requests wait; a session that can
// release the lease of another. One thread asks for both: lease_race_test.cpp has clients on threads of their
// own.
TEST(ThreadedEngine, OWN_01_OfTwoRequestsInTheQueueTheFirstGetsTheAxis) {
  BenchConfig config = servo_bench();
  config.mode = RunMode::kFree;
  asio::io_context io(1);
  const auto engine = make_threaded_engine(config, nullptr, io, std::nullopt);
  constexpr int kRaces = 10'000;
  constexpr int kAtOnce = 50;  // four requests each, which fit into the queue
  int races = 0;
  std::vector<Refused> answers;
  std::size_t answered = 0;
  std::function<void()> race = [&] {
    answers.clear();
    answered = 0;
    for (int n = 0; n < kAtOnce; ++n) {
      const Owner first = n % 2 == 0 ? kMe : kStranger;
      for (const LeaseAction action : {LeaseAction::kAcquire, LeaseAction::kRelease}) {
        for (const Owner who : {first, kMe + kStranger - first}) {
          // A refusal for want of the lease does not wait for a tick, so that it may come first.
          answers.push_back(Refused::kBusy);
          engine->request(lease(action, 0, who), [&, place = answers.size() - 1](Refused refused, Tick) {
            answers[place] = refused;
            if (++answered < 4 * kAtOnce) return;
            for (std::size_t i = 0; i < answers.size(); i += 4) {
              EXPECT_EQ(std::vector(answers.begin() + static_cast<std::ptrdiff_t>(i),
                                    answers.begin() + static_cast<std::ptrdiff_t>(i) + 4),
                        (std::vector{Refused::kNot, Refused::kOwned, Refused::kNot, Refused::kNotOwner}));
            }
            races += kAtOnce;
            asio::post(io, [&] { races < kRaces ? race() : io.stop(); });
          });
        }
      }
    }
  };
  race();
  io.run();
  EXPECT_EQ(races, kRaces);
  engine->stop();
}

// Catches: a queue of requests without end. More of them than fit are refused at once, and every one is
// answered once.
TEST(ThreadedEngine, TooManyRequestsAreRefusedAsBusy) {
  BenchConfig config = servo_bench();
  config.mode = RunMode::kFree;
  asio::io_context io(1);
  const auto engine = make_threaded_engine(config, nullptr, io, std::nullopt);
  // While nothing is drained here, the bench can report at most as many outcomes as its queue holds.
  constexpr int kRequests = 20'000;
  int busy = 0;
  int answered = 0;
  for (int n = 0; n < kRequests; ++n) {
    engine->request(lease(LeaseAction::kAcquire), [&](Refused refused, Tick) {
      ++answered;
      if (refused == Refused::kBusy) ++busy;
      if (answered == kRequests) io.stop();
    });
  }
  EXPECT_GT(busy, 0);
  EXPECT_EQ(answered, busy);
  io.run();
  EXPECT_EQ(answered, kRequests);
  engine->stop();
}

// Catches: an axis that stays taken because the end of its lease found no room; refused commands of another
// session that leave the owner no room.
TEST(ThreadedEngine, RenewalsAndEndsOfLeasesGetThroughAFullQueue) {
  asio::io_context io(1);
  BenchConfig config = servo_bench();
  config.mode = RunMode::kFree;
  SteppedEngine stepped = make_stepped_engine(config, nullptr, io, make_free_pacer());
  Engine& engine = *stepped.engine;
  std::vector<Refused> answers;
  const auto note = [&answers](Refused refused, Tick) { answers.push_back(refused); };
  const auto run = [&](int ticks) {
    for (int i = 0; i < ticks; ++i)
      stepped.tick();
    io.restart();
    io.poll();
  };
  constexpr int kTicksPerWake = 1024;
  engine.request(lease(LeaseAction::kAcquire), note);
  run(kTicksPerWake);
  ASSERT_EQ(engine.owner(0), kMe);
  for (int i = 0; i < 1000; ++i)
    engine.command(0, kStranger, voltage(0, 1.0, 0.0));
  engine.request(lease(LeaseAction::kRenew), note);
  run(kTicksPerWake);
  EXPECT_EQ(answers, (std::vector<Refused>{Refused::kNot, Refused::kNot}));
  for (int i = 0; i < 1000; ++i)
    engine.request({.tick = 0, .axis = 0, .owner = 0, .action = LoadChange{}}, [](Refused, Tick) {});
  engine.request(lease(LeaseAction::kLost), note);
  run(kTicksPerWake);
  run(kTicksPerWake);
  EXPECT_EQ(engine.owner(0), 0u);
  EXPECT_EQ(answers.size(), 3u);
  engine.stop();
}

// Catches: commands that never reach the tick thread, real time that waits for them, and a run of a given
// length that is longer or shorter.
TEST(ThreadedEngine, RealtimeTakesCommandsAndEndsByItself) {
  BenchConfig config = servo_bench();
  config.mode = RunMode::kRealtime;
  config.setup.command_delay_ticks = 1;
  config.setup.watchdog_ticks = 1'000'000;
  config.realtime.max_lateness_ns = 3'600'000'000'000;  // a slow machine is late here, not in error
  asio::io_context io(1);
  const auto engine = make_threaded_engine(config, nullptr, io, 2000);
  bool owned = false;
  std::uint64_t commanded = 0;
  bool ended = false;
  engine->request(lease(LeaseAction::kAcquire),
                  [&owned](Refused refused, Tick) { owned = refused == Refused::kNot; });
  engine->on_tick.add([&] {
    if (owned) engine->command(0, kMe, voltage(engine->tick(), 12.0, 0.0));
    if (engine->newest(0).u_a_v == 12.0) ++commanded;
  });
  engine->on_end = [&] {
    ended = true;
    io.stop();
  };
  io.run();
  EXPECT_TRUE(ended);
  const Verdict verdict = engine->stop();
  EXPECT_EQ(verdict.ticks, 2001u) << "the last tick is one of safe action";
  EXPECT_GT(commanded, 0u);
  EXPECT_EQ(engine->state_hash(), 0u) << "another thread owns the state";
  EXPECT_EQ(verdict.realtime_valid(), verdict.late_ticks == 0);
}

// Catches: a bad command that reaches the tick thread, or is not counted there.
TEST(ThreadedEngine, BadCommandsAreRefusedAtOnceAndCountedByTheBench) {
  BenchConfig config = servo_bench();
  config.mode = RunMode::kFree;
  asio::io_context io(1);
  const auto engine = make_threaded_engine(config, nullptr, io, std::nullopt);
  EXPECT_EQ(engine->command(0, kMe, voltage(0, 1.0, 0.0)), Refused::kNotOwner);
  engine->request(lease(LeaseAction::kAcquire), [&](Refused, Tick) {
    EXPECT_EQ(engine->owner(0), kMe);
    EXPECT_EQ(engine->command(0, kMe, voltage(0, std::nan(""), 0.0)), Refused::kNotFinite);
    EXPECT_EQ(engine->command(0, kMe, voltage(1ll << 60, 1.0, 0.0)), Refused::kStale);
    EXPECT_EQ(engine->command(0, kStranger, voltage(0, 1.0, 0.0)), Refused::kNotOwner);
    engine->request(lease(LeaseAction::kRenew), [&](Refused, Tick) { io.stop(); });
  });
  io.run();
  EXPECT_EQ(engine->newest(0).refused_commands, 2u) << "those of the controller";
  engine->stop();
}

// Catches: an overrun that is only counted. The first tick is due at once; the next one comes after the limit
// because the I/O thread cannot delay it, so the limit is set to nothing.
TEST(ThreadedEngine, OS_03_LatenessBeyondTheLimitIsALatchedFault) {
  BenchConfig config = servo_bench();
  config.mode = RunMode::kRealtime;
  config.realtime.pacer = PacerKind::kSleep;
  config.realtime.max_lateness_ns = -1;  // every tick is beyond it
  asio::io_context io(1);
  const auto engine = make_threaded_engine(config, nullptr, io, 20);
  engine->on_end = [&io] { io.stop(); };
  io.run();
  const Verdict verdict = engine->stop();
  EXPECT_EQ(verdict.late_ticks, 20u);
  EXPECT_NE(engine->newest(0).faults & kBenchOverrun, 0u);
  EXPECT_FALSE(verdict.realtime_valid());
}

/// The third tick is too late.
class LatePacer final : public Pacer {
 public:
  std::int64_t wait() noexcept override { return ++ticks_ == 3 ? 1'000'000'000 : 0; }
  void resynchronise() noexcept override {}

 private:
  int ticks_ = 0;
};

// Catches: a clear that waits for the late tick and takes its fault away before a sample has shown it, so
// that the axis becomes idle without a reason.
TEST(ThreadedEngine, OS_03_AClearBeforeALateTickDoesNotHideItsFault) {
  BenchConfig config = servo_bench();
  config.mode = RunMode::kRealtime;
  asio::io_context io(1);
  SteppedEngine stepped = make_stepped_engine(config, nullptr, io, std::make_unique<LatePacer>());
  Engine& engine = *stepped.engine;
  const auto tick = [&] {
    stepped.tick();
    io.restart();
    io.poll();
  };
  const auto ask = [&](const Action& action) {
    engine.request({.tick = 0, .axis = 0, .owner = 1, .action = action}, [](Refused, Tick) {});
  };
  ask(LeaseAction::kAcquire);
  tick();
  tick();
  ask(ClearFaults{});
  tick();
  EXPECT_EQ(engine.newest(0).faults, kBenchOverrun);
  ask(ClearFaults{});
  tick();
  EXPECT_EQ(engine.newest(0).faults, 0u) << "a fault that was shown can be cleared";
  engine.stop();
}

// Catches: a thread that outlives an engine which was never stopped.
TEST(ThreadedEngine, MayBeDestroyedWhileItRuns) {
  asio::io_context io(1);
  BenchConfig config = free_bench();
  make_threaded_engine(config, nullptr, io, std::nullopt).reset();
}

}  // namespace
}  // namespace drivebench::engine_test
