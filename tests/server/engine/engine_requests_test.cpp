// Requests on their way to the thread of the ticks, when there are many.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "server/engine/engine.hpp"
#include "server/engine/stepped_engine.hpp"
#include "server/host/asio.hpp"
#include "server/pacing/pacer.hpp"
#include "tests/server/engine/engine_requests.hpp"
#include "tests/server/recording/run_config.hpp"

namespace drivebench::engine_requests_test {
namespace {

constexpr std::size_t kRequestsThatWait = 256;

/// A free run of one axis, owned by kMe, whose ticks the test runs one by one.
class EngineRequests : public testing::Test {
 protected:
  EngineRequests() {
    engine().request(lease(LeaseAction::kAcquire), [](Refused, Tick) {});
    run();
    EXPECT_EQ(engine().owner(0), kMe);
  }
  ~EngineRequests() override { engine().stop(); }

  Engine& engine() { return *stepped_.engine; }
  Engine::Answer noted() {
    return [this](Refused refused, Tick) { answers_.push_back(refused); };
  }
  void fill(std::size_t count) {
    for (std::size_t i = 0; i < count; ++i)
      engine().request({.tick = 0, .axis = 0, .owner = 0, .action = LoadChange{}}, [](Refused, Tick) {});
  }
  /// Runs ticks until the I/O thread is woken, and then that thread.
  void run() {
    constexpr int kTicksPerWake = 1024;
    for (int i = 0; i < kTicksPerWake; ++i)
      stepped_.tick();
    io_.restart();
    io_.poll();
  }

  asio::io_context io_{1};
  SteppedEngine stepped_ = make_stepped_engine(
      [] {
        BenchConfig config = servo_bench();
        config.mode = RunMode::kFree;
        return config;
      }(),
      nullptr, io_, make_free_pacer());
  std::vector<Refused> answers_;
};

// Catches: an axis taken from its owner while the queue has no room to give it to the new one.
TEST_F(EngineRequests, OWN_04_TakingAnAxisDoesBothStepsOrNone) {
  for (const std::size_t filled : {kRequestsThatWait - 1, kRequestsThatWait, 2 * kRequestsThatWait}) {
    fill(filled);
    answers_.clear();
    engine().take(0, kStranger, "mine", noted());
    EXPECT_EQ(answers_, std::vector{Refused::kBusy}) << filled << " wait";
    run();
    run();
    EXPECT_EQ(engine().owner(0), kMe) << filled << " wait";
  }
  fill(kRequestsThatWait - 2);
  engine().take(0, kStranger, "mine", noted());
  run();
  EXPECT_EQ(engine().owner(0), kStranger);
}

// Catches: a lease that is asked for after its end and granted before it, so that its owner loses it at once.
TEST_F(EngineRequests, NoRequestOvertakesAWaitingEndOfALease) {
  fill(kRequestsThatWait);
  engine().request(lease(LeaseAction::kRelease), noted());
  stepped_.tick();  // makes room that the I/O thread does not know of
  engine().request(lease(LeaseAction::kAcquire), noted());
  engine().request(lease(LeaseAction::kLost, 0, kStranger), noted());
  engine().take(0, kStranger, "mine", noted());
  run();
  run();
  EXPECT_EQ(engine().owner(0), 0u);
  EXPECT_EQ(answers_, (std::vector{Refused::kBusy, Refused::kBusy, Refused::kBusy, Refused::kNot}));
}

// Catches: a queue of lease ends without a bound, sent by the controller or by sessions that hold no lease.
TEST_F(EngineRequests, AtMostOneEndOfALeaseWaitsForEachOwner) {
  fill(kRequestsThatWait);
  for (int i = 0; i < 1000; ++i)
    engine().request(lease(LeaseAction::kRelease, 0, kStranger), noted());
  EXPECT_EQ(answers_.size(), 1000u) << "none waits";
  for (int i = 0; i < 1000; ++i)
    engine().request(lease(LeaseAction::kRelease), noted());
  EXPECT_EQ(answers_, std::vector(1999, Refused::kBusy));
  run();
  run();
  EXPECT_EQ(engine().owner(0), 0u);
  EXPECT_EQ(answers_.size(), 2000u);
}

}  // namespace
}  // namespace drivebench::engine_requests_test
