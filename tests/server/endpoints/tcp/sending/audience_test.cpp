#include "server/endpoints/tcp/sending/audience.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "tests/server/recording/run_config.hpp"

namespace drivebench::audience_test {
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

// Catches: a viewer that makes the server keep 0.1 MB for every number that it thinks of; a limit that shuts
// out clients that want every sample, or a decimation that is there; places that are not given back.
TEST(Audience, LIMIT_03_FeedsOfManyDecimationsHaveAnEnd) {
  asio::io_context io(1);
  const std::unique_ptr<Engine> engine = make_lockstep_engine(servo_bench());
  Audience audience(io, *engine);
  std::vector<std::shared_ptr<const SampleFeed>> feeds;
  for (std::uint32_t n = 0; n < Audience::kMostDecimatedFeeds; ++n)
    feeds.push_back(audience.feed(0, n + 2));
  EXPECT_NE(feeds.back(), nullptr);
  EXPECT_EQ(audience.feed(0, 1000), nullptr);
  EXPECT_EQ(audience.feed(0, 2), feeds.front());
  EXPECT_NE(audience.feed(0, 1), nullptr);
  feeds.pop_back();
  EXPECT_NE(audience.feed(0, 1000), nullptr);
  engine->stop();
}

}  // namespace
}  // namespace drivebench::audience_test
