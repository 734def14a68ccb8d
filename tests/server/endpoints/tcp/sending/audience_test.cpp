#include "server/endpoints/tcp/sending/audience.hpp"

#include <gtest/gtest.h>

#include <memory>

#include "tests/server/recording/run_config.hpp"

namespace drivebench {
namespace {

// Catches: rings that nobody reads any more and that every tick fills, as many as there have been viewers.
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
  EXPECT_FALSE(kept.expired()) << "somebody reads it still";
  second.reset();
  audience.on_tick();
  EXPECT_TRUE(kept.expired()) << "after the next tick";
  engine->stop();
}

}  // namespace
}  // namespace drivebench
