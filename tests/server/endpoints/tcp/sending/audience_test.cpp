#include "server/endpoints/tcp/sending/audience.hpp"

#include <gtest/gtest.h>

#include <memory>

#include "tests/server/recording/run_config.hpp"

namespace drivebench {
namespace {

// Catches: rings without a reader that every tick goes on filling, one for each viewer there has been.
TEST(Audience, AFeedEndsWithItsLastReader) {
  asio::io_context io(1);
  const std::unique_ptr<Engine> engine = make_lockstep_engine(servo_bench());
  Audience audience(io, *engine);
  std::shared_ptr<const SampleFeed> first = audience.feed(0, 8);
  std::shared_ptr<const SampleFeed> second = audience.feed(0, 8);
  EXPECT_EQ(first, second) << "kept once for all";
  const std::weak_ptr<const SampleFeed> kept = first;
  first.reset();
  audience.on_tick();
  EXPECT_FALSE(kept.expired()) << "one reader is left";
  second.reset();
  audience.on_tick();
  EXPECT_TRUE(kept.expired()) << "after the next tick";
  engine->stop();
}

}  // namespace
}  // namespace drivebench
