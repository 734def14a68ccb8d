#include "server/access/seat.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "plant/faults.hpp"
#include "server/engine/stepped_engine.hpp"
#include "server/host/asio.hpp"
#include "server/pacing/pacer.hpp"
#include "tests/server/recording/run_config.hpp"

namespace drivebench::seat_test {
namespace {

using namespace std::chrono_literals;

const Client kAnna{.transport = "can", .peer = "vcan0 controller 1", .subject = {}};
const Client kBert{.transport = "modbus", .peer = "127.0.0.1:5000", .subject = {}};

/// Two seats at one axis of a lockstep bench, which answers at once.
class SeatTest : public testing::Test {
 protected:
  ~SeatTest() override { engine_->stop(); }

  Refused acquire(Seat& seat, const Client& client) {
    return ask(seat, LeaseAction::kAcquire, seat.number_for(client));
  }
  static Refused ask(Seat& seat, LeaseAction action, Owner number) {
    Refused found = Refused::kBusy;
    seat.ask(action, number, [&found](Refused refused, Tick) { found = refused; });
    return found;
  }
  /// A tick in which the holder drives the axis.
  void drive(const Seat& seat) {
    EXPECT_EQ(engine_->command(0, seat.owner(), voltage(engine_->tick(), 1.0, 0.0)), Refused::kNot);
    engine_->advance();
  }

  std::unique_ptr<Engine> engine_ = make_lockstep_engine(servo_bench(2));
  Seat anna_{*engine_, 0};
  Seat bert_{*engine_, 0};
};

// Catches: a seat that is taken although the bench refused, or empty although the bench granted.
TEST_F(SeatTest, TheSeatFollowsTheDecisionOfTheBench) {
  EXPECT_EQ(anna_.owner(), 0u);
  EXPECT_FALSE(anna_.is_held());
  EXPECT_EQ(acquire(anna_, kAnna), Refused::kNot);
  EXPECT_EQ(anna_.owner(), engine_->owner(0));
  EXPECT_TRUE(anna_.is_held());
  EXPECT_EQ(acquire(bert_, kBert), Refused::kOwned);
  EXPECT_EQ(bert_.owner(), 0u);
  EXPECT_EQ(ask(bert_, LeaseAction::kRelease, 4711), Refused::kNotOwner);
  EXPECT_TRUE(anna_.is_held());
}

// Catches: a number that two holders have in turn, or a new number with each renewal.
TEST_F(SeatTest, EveryHolderHasANumberOfItsOwn) {
  acquire(anna_, kAnna);
  const Owner first = anna_.owner();
  EXPECT_EQ(acquire(anna_, kAnna), Refused::kNot) << "acquired again by its holder";
  EXPECT_EQ(ask(anna_, LeaseAction::kRenew, anna_.owner()), Refused::kNot);
  EXPECT_EQ(anna_.owner(), first);
  EXPECT_EQ(ask(anna_, LeaseAction::kRelease, anna_.owner()), Refused::kNot);
  EXPECT_EQ(anna_.owner(), 0u);
  EXPECT_EQ(engine_->owner(0), 0u);
  acquire(bert_, kBert);
  EXPECT_GT(bert_.owner(), first);
  EXPECT_EQ(engine_->client(bert_.owner())->peer, kBert.peer);
}

// Catches: a lost lease that leaves the axis as a released one does, or a released one that latches.
TEST_F(SeatTest, ALossLatchesAndAReleaseDoesNot) {
  acquire(anna_, kAnna);
  drive(anna_);
  anna_.give_back();
  EXPECT_EQ(anna_.owner(), 0u);
  EXPECT_EQ(engine_->owner(0), 0u);
  acquire(bert_, kBert);
  drive(bert_);
  EXPECT_EQ(engine_->newest(0).faults & kLeaseLost, 0u);
  bert_.lose();
  EXPECT_EQ(bert_.owner(), 0u);
  EXPECT_EQ(engine_->owner(0), 0u);
  acquire(anna_, kAnna);
  EXPECT_EQ(engine_->command(0, anna_.owner(), voltage(engine_->tick(), 1.0, 0.0)), Refused::kLatched);
  EXPECT_EQ(engine_->command(0, anna_.owner(), {.answers = engine_->tick(), .phases = {}}), Refused::kNot);
  engine_->advance();
  EXPECT_NE(engine_->newest(0).faults & kLeaseLost, 0u);
}

// Catches: an empty seat that ends the lease of another one.
TEST_F(SeatTest, AnEmptySeatEndsNothing) {
  acquire(anna_, kAnna);
  bert_.lose();
  bert_.give_back();
  EXPECT_FALSE(bert_.notice_end());
  EXPECT_TRUE(anna_.is_held());
}

// Catches: a lease taken by force that its seat keeps, that empties the seat of another axis or of the new
// holder, or whose new holder has the older number.
TEST_F(SeatTest, TakingByForceEmptiesTheSeatOfTheOldHolderAlone) {
  Seat other_axis(*engine_, 1);
  acquire(anna_, kAnna);
  const Owner old = anna_.owner();
  ASSERT_EQ(ask(other_axis, LeaseAction::kAcquire, old), Refused::kNot) << "one number for two axes";
  std::vector<bool> noticed;
  engine_->on_taken.push_back([&](const Taken& taken) {
    noticed = {anna_.notice_taken(taken), bert_.notice_taken(taken), other_axis.notice_taken(taken)};
  });
  Refused answer = Refused::kBusy;
  bert_.take(engine_->new_owner(kBert), "maintenance", [&](Refused refused, Tick) { answer = refused; });
  EXPECT_EQ(answer, Refused::kNot);
  EXPECT_EQ(noticed, (std::vector<bool>{true, false, false}));
  EXPECT_EQ(anna_.owner(), 0u);
  EXPECT_TRUE(other_axis.is_held());
  EXPECT_TRUE(bert_.is_held());
  EXPECT_GT(bert_.owner(), old);
}

// Catches: a client that is told that it lost an axis by force, although its own lease had ended before.
TEST_F(SeatTest, ASeatWhoseLeaseHasEndedNoticesNoTakingByForce) {
  acquire(anna_, kAnna);
  engine_->request({.tick = 0, .axis = 0, .owner = anna_.owner(), .action = LeaseAction::kLost},
                   [](Refused, Tick) {});
  acquire(bert_, kBert);
  std::vector<bool> noticed;
  engine_->on_taken.push_back([&](const Taken& taken) {
    noticed = {anna_.notice_taken(taken), bert_.notice_taken(taken)};
  });
  engine_->take(0, engine_->new_owner(kAnna), "maintenance", [](Refused, Tick) {});
  EXPECT_EQ(noticed, (std::vector<bool>{false, true}));
}

// Catches: a limit that ends one look too early or too late, and a client that loses its lease because it
// waits for the bench.
TEST_F(SeatTest, SilenceCountsFromTheLastSignOfLife) {
  const Seat::Clock::time_point start{1h};
  anna_.hear(start);
  EXPECT_FALSE(anna_.is_silent(start + 49ms, 50ms));
  EXPECT_TRUE(anna_.is_silent(start + 50ms, 50ms));
  anna_.wait(start + 40ms);
  EXPECT_FALSE(anna_.is_silent(start + 89ms, 50ms)) << "it waited";
  EXPECT_TRUE(anna_.is_silent(start + 90ms, 50ms));
  EXPECT_TRUE(anna_.is_unheard(start + 50ms, 50ms)) << "heartbeats come while a client waits, too";
  anna_.hear(start + 60ms);
  EXPECT_EQ(anna_.silent_since(), start + 60ms);
  EXPECT_FALSE(anna_.is_unheard(start + 109ms, 50ms));
}

/// A free run that answers after its ticks.
class SlowSeatTest : public testing::Test {
 protected:
  ~SlowSeatTest() override { stepped_.engine->stop(); }
  /// Runs 1024 ticks, after which the engine tells the I/O thread, and then the I/O thread.
  void run() {
    constexpr int kTicksPerWake = 1024;
    for (int i = 0; i < kTicksPerWake; ++i)
      stepped_.tick();
    io_.restart();
    io_.poll();
  }
  void acquire() {
    seat_.ask(LeaseAction::kAcquire, seat_.number_for(kAnna), [](Refused, Tick) {});
    run();
  }

  asio::io_context io_{1};
  SteppedEngine stepped_ = make_stepped_engine(
      [] {
        BenchConfig config = servo_bench();
        config.mode = RunMode::kFree;
        config.setup.lease_ticks = 3000;
        return config;
      }(),
      nullptr, io_, make_free_pacer());
  Seat seat_{*stepped_.engine, 0};
};

// Catches: a seat that is taken before the bench has answered, or that forgets that it asked.
TEST_F(SlowSeatTest, TheSeatWaitsForTheAnswer) {
  const Owner number = seat_.number_for(kAnna);
  Owner at_answer = 0;
  seat_.ask(LeaseAction::kAcquire, number, [&](Refused, Tick) { at_answer = seat_.owner(); });
  EXPECT_EQ(seat_.owner(), 0u);
  EXPECT_TRUE(seat_.is_acquiring());
  run();
  EXPECT_EQ(at_answer, number) << "the seat is up to date when the transport has the answer";
  EXPECT_FALSE(seat_.is_acquiring());
  seat_.ask(LeaseAction::kRelease, number, [](Refused, Tick) {});
  EXPECT_TRUE(seat_.is_asking());
  EXPECT_FALSE(seat_.is_acquiring());
  EXPECT_EQ(seat_.owner(), number);
  run();
  EXPECT_FALSE(seat_.is_asking());
  EXPECT_EQ(seat_.owner(), 0u);
}

// Catches: a renewal that does not reach the bench, a lease that ran out and stays in its seat, or an end
// that is told twice.
TEST_F(SlowSeatTest, ALeaseThatIsNotRenewedRunsOut) {
  acquire();
  for (int i = 0; i < 5; ++i) {  // longer than a lease
    seat_.ask(LeaseAction::kRenew, seat_.owner(), [](Refused, Tick) {});
    run();
    EXPECT_TRUE(seat_.is_held());
    EXPECT_FALSE(seat_.notice_end());
  }
  for (int i = 0; i < 3; ++i)
    run();
  EXPECT_FALSE(seat_.is_held());
  EXPECT_NE(seat_.owner(), 0u) << "not noticed yet";
  EXPECT_TRUE(seat_.notice_end());
  EXPECT_EQ(seat_.owner(), 0u);
  EXPECT_FALSE(seat_.notice_end());
}

// Catches: a lost seat that stays taken until the bench has heard of it, so that the client still commands.
TEST_F(SlowSeatTest, ALossEmptiesTheSeatAtOnce) {
  acquire();
  const Owner first = seat_.owner();
  seat_.lose();
  EXPECT_EQ(seat_.owner(), 0u);
  EXPECT_EQ(stepped_.engine->owner(0), first) << "the bench hears of it with the next tick";
  EXPECT_FALSE(seat_.notice_end()) << "the transport ended the lease itself";
  acquire();
  EXPECT_GT(seat_.owner(), first);
  EXPECT_TRUE(seat_.is_held());
}

}  // namespace
}  // namespace drivebench::seat_test
