// Limits on the number of connections, on their rate and on their silence, and the log of each.
#include <sstream>

#include "tests/repetitions.hpp"
#include "tests/server/endpoints/modbus/modbus_bench.hpp"

namespace drivebench::modbus::limits_test {
namespace {

/// Number of lines with these words.
int lines_with(const std::string& words, const std::string& log) {
  int count = 0;
  std::istringstream lines(log);
  for (std::string line; std::getline(lines, line);)
    count += line.find(words) != std::string::npos ? 1 : 0;
  return count;
}

// Catches: one peer that takes every place and keeps the owner of an axis out.
TEST(Modbus, OnePeerCannotTakeAllConnections) {
  testing::internal::CaptureStderr();  // the default place of the log
  {
    BenchConfig config = modbus_bench_config();
    config.modbus.max_connections = 4;
    config.modbus.idle_timeout_ms = 1'000'000;
    ModbusBench bench(config);
    std::vector<std::unique_ptr<Client>> hoard;
    for (int i = 0; i < 4; ++i) {
      hoard.push_back(std::make_unique<Client>(bench.port(), "127.0.0.2"));
      ASSERT_EQ(hoard.back()->read_one(0), kMarker);
    }
    ASSERT_EQ(hoard[1]->write(400, {7}), 0);
    for (const int i : {0, 2, 3})
      ASSERT_EQ(hoard[static_cast<std::size_t>(i)]->read_one(0), kMarker);
    Client fifth(bench.port(), "127.0.0.2");
    EXPECT_TRUE(fifth.is_closed()) << "a peer that has all connections gets no more";
    Client owner(bench.port());
    EXPECT_EQ(owner.read_one(0), kMarker);
    EXPECT_TRUE(hoard[0]->is_closed()) << "the idlest connection without a lease";
    EXPECT_EQ(hoard[1]->read_one(409), 1) << "a connection that drives a motor stays";
    Client guest(bench.port(), "127.0.0.3");
    EXPECT_EQ(guest.read_one(0), kMarker);
    EXPECT_TRUE(hoard[2]->is_closed());
    Client second(bench.port());
    EXPECT_TRUE(second.is_closed()) << "it would have as many connections as the other peer";
    EXPECT_EQ(owner.read_one(0), kMarker);
    EXPECT_EQ(bench.count("turned_away"), 2u);
    EXPECT_EQ(bench.count("cut"), 2u);
    EXPECT_EQ(bench.count("connections"), 4u);
  }
  const std::string log = testing::internal::GetCapturedStderr();
  EXPECT_EQ(lines_with("127.0.0.2 was turned away", log), 1);
  EXPECT_EQ(lines_with("turned away", log), 1) << "the second within the limit of the log";
}

// Catches: a log that a client fills by acquiring leases; a connection that was closed but is called silent.
TEST(Modbus, LapsedLeasesAreLoggedOnceAndByTheirReason) {
  BenchConfig config = modbus_bench_config();
  config.setup.lease_ticks = 20'000'000 / config.setup.period_ns;
  testing::internal::CaptureStderr();
  {
    ModbusBench bench(config);
    for (int i = 0; i < 3; ++i) {
      {
        Client client(bench.port());
        ASSERT_EQ(client.write(400, {7}), 0);
      }
      bench.until([&] { return bench.owner() == 0; });
    }
  }
  const std::string goodbyes = testing::internal::GetCapturedStderr();
  EXPECT_EQ(lines_with("the owner of axis 0 went away", goodbyes), 1);
  EXPECT_EQ(lines_with("loses its lease", goodbyes), 1);
  EXPECT_EQ(lines_with("silent", goodbyes), 0);
  config.modbus.idle_timeout_ms = 20;
  testing::internal::CaptureStderr();
  {
    ModbusBench bench(config);
    Client client(bench.port());
    ASSERT_EQ(client.write(400, {7}), 0);
    bench.until([&] { return bench.owner() == 0; });
  }
  EXPECT_EQ(lines_with("the owner of axis 0 has fallen silent", testing::internal::GetCapturedStderr()), 1);
}

// Catches: a connection that is cut although nothing has been refused yet.
TEST(Modbus, ARateOfOneRefusesBeforeItCuts) {
  using Answer = RateLimit::Answer;
  const auto peer = asio::ip::make_address("127.0.0.1");
  const RateLimit::Clock::time_point now{};
  for (const std::uint32_t rate : {1u, 3u}) {
    RateLimit limit(rate);
    for (const Answer expected : {Answer::kServe, Answer::kRefuse}) {
      for (std::uint32_t i = 0; i < rate; ++i)
        EXPECT_EQ(limit.charge(peer, now), expected) << rate;
    }
    EXPECT_EQ(limit.charge(peer, now), Answer::kCut) << rate;
  }
}

// Catches: a refusal below the rate, a second's worth of requests that is refused when it comes at once, and
// a bucket that is filled slightly too fast or too slowly, which shows after an hour.
TEST(Modbus, LIMIT_06_JustBelowTheRateEverythingIsAnswered) {
  using Answer = RateLimit::Answer;
  constexpr std::uint32_t kRate = 2000;
  const auto peer = asio::ip::make_address("127.0.0.1");
  // Requests that are served one after the other, evenly spread in virtual time.
  const auto served = [&](std::uint32_t requests_per_s, std::uint32_t most) {
    RateLimit limit(kRate);
    std::uint32_t count = 0;
    for (; count < most; ++count) {
      const RateLimit::Clock::time_point now{
          std::chrono::nanoseconds(1'000'000'000LL * count / requests_per_s)};
      if (limit.charge(peer, now) != Answer::kServe) break;
    }
    return count;
  };
  constexpr std::uint32_t kHour = repetitions(3600u) * kRate;
  EXPECT_EQ(served(kRate - 1, kHour), kHour);
  EXPECT_EQ(served(kRate, kHour), kHour);
  // Request n comes after (n - 1)/2100 s: 2000 + (n - 1) 2000/2100 >= n up to n = 41980; one less by
  // rounding.
  EXPECT_NEAR(served(kRate + 100, kHour), 41'980, 1);
  RateLimit limit(kRate);
  for (int second = 0; second < 60; ++second) {
    const RateLimit::Clock::time_point now{std::chrono::seconds(second)};
    for (std::uint32_t i = 0; i < kRate; ++i)
      ASSERT_EQ(limit.charge(peer, now), Answer::kServe) << i << " at once after " << second << " s";
    EXPECT_EQ(limit.charge(peer, now), Answer::kRefuse);
    limit.refund(peer, 1.0);  // so that each second begins with an empty bucket
  }
  BenchConfig config = modbus_bench_config();
  config.modbus.requests_per_s = 50;
  ModbusBench bench(config);
  Client client(bench.port());
  for (int i = 0; i < 50; ++i)
    ASSERT_EQ(client.read_one(0), kMarker) << "the bucket holds a second's worth, " << i;
  EXPECT_EQ(bench.count("throttled"), 0u);
}

}  // namespace
}  // namespace drivebench::modbus::limits_test
