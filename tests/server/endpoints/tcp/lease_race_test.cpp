// Clients on threads of their own that ask for the same axis of a server that runs in real time.
#include <gtest/gtest.h>

#include <atomic>
#include <barrier>
#include <chrono>
#include <functional>
#include <random>
#include <thread>
#include <vector>

#include "clients/link/tcp/tcp_link.hpp"
#include "server/endpoints/tcp/stream_server.hpp"
#include "tests/server/recording/run_config.hpp"

namespace drivebench::lease_race_test {
namespace {

constexpr std::size_t kClients = 4;

/// A server with its threads: one for ticks in real time, one for I/O. Lateness is no fault, and a lease does
/// not run out: the machine may be busy.
class RacedServer {
 public:
  RacedServer() {
    server_.serve(
        *engine_, [] { return std::vector<TransportReport>(); }, nullptr);
    thread_ = std::thread([this] { io_.run(); });
  }
  ~RacedServer() {
    asio::post(io_, [this] { io_.stop(); });
    thread_.join();
    engine_->stop();
    server_.close();
  }
  RacedServer(const RacedServer&) = delete;
  RacedServer& operator=(const RacedServer&) = delete;

  /// Every second client uses the unix socket.
  std::string address(std::size_t client) const {
    return client % 2 == 0 ? "tcp:" + server_.tcp_address() : "unix:" + path_.string();
  }

 private:
  static BenchConfig configuration() {
    BenchConfig config = servo_bench();
    config.mode = RunMode::kRealtime;
    config.setup.command_delay_ticks = 1;
    config.setup.lease_ticks = Tick{1} << 40;
    config.realtime.max_lateness_ns = 60'000'000'000;
    config.realtime.pacer = PacerKind::kSleep;
    return config;
  }
  TcpConfig places() const {
    TcpConfig config;
    config.port = 0;
    config.unix_path = path_.string();
    return config;
  }

  TestFolder folder_;
  std::filesystem::path path_ = folder_ / "socket";
  asio::io_context io_{1};
  std::unique_ptr<Engine> engine_ = make_threaded_engine(configuration(), nullptr, io_, std::nullopt);
  StreamServer server_{io_, places()};
  std::thread thread_;
};

/// Runs `play` for each client on a thread of its own.
void on_threads(const RacedServer& server, const std::function<void(std::size_t, link::Link&)>& play) {
  std::vector<std::thread> threads;
  for (std::size_t client = 0; client < kClients; ++client) {
    threads.emplace_back([&server, &play, client] {
      link::Link link(server.address(client), {.deadline = std::chrono::minutes(2)});
      play(client, link);
    });
  }
  for (std::thread& thread : threads)
    thread.join();
}

bool wins(link::Link& link) {
  try {
    link.acquire(0);
    return true;
  } catch (const link::RefusalError& refused) {
    EXPECT_EQ(refused.code(), v1::REFUSAL_OWNED) << refused.what();
    return false;
  }
}

/// Puts a thread at a random place in each race. Without it the last winner, which closes the gate awake
/// while the others sleep at it, wins up to 500 races in a row where the threads share a CPU.
class HeadStart {
 public:
  explicit HeadStart(std::size_t client) : random_(static_cast<unsigned>(client)) {}
  void wait() { std::this_thread::sleep_for(std::chrono::microseconds(random_() % kLongest_us)); }

 private:
  static constexpr unsigned kLongest_us = 500;
  std::minstd_rand random_;
};

// Catches: an axis with two owners, or none, when clients on several threads and transports ask at the same
// moment.
TEST(LeaseRace, OWN_01_OfFourThreadsThatAskAtOnceOneGetsTheAxis) {
  constexpr std::size_t kRaces = 500;
  const RacedServer server;
  std::barrier gate(kClients);
  std::vector<std::atomic<int>> winners(kRaces);
  std::atomic<int> losers_who_won_later{0};
  on_threads(server, [&](std::size_t client, link::Link& link) {
    HeadStart head_start(client + 1);
    bool has_lost = false;
    for (std::atomic<int>& won : winners) {
      gate.arrive_and_wait();
      head_start.wait();
      const bool is_mine = wins(link);
      if (is_mine) ++won;
      if (is_mine && has_lost) ++losers_who_won_later;
      has_lost = has_lost || !is_mine;
      gate.arrive_and_wait();  // the winner keeps the axis until all have asked
      if (is_mine) {
        EXPECT_NO_THROW(link.release(0));
      }
    }
  });
  for (const std::atomic<int>& won : winners)
    EXPECT_EQ(won, 1);
  EXPECT_GT(losers_who_won_later, 0) << "the same client was always first: this was no race";
}

// Catches: an axis that goes to a second owner before the first one has given it back. Nothing keeps the
// threads in step.
TEST(LeaseRace, OWN_01_TwoThreadsNeverHoldTheAxisAtTheSameTime) {
  constexpr int kTurns = 100;
  const RacedServer server;
  std::atomic<int> holders{0};
  std::atomic<int> refusals{0};
  std::vector<std::uint64_t> turns(kClients);
  on_threads(server, [&](std::size_t client, link::Link& link) {
    while (turns[client] < kTurns) {
      if (!wins(link)) {
        ++refusals;
        continue;
      }
      EXPECT_EQ(holders.fetch_add(1), 0);
      EXPECT_NO_THROW(link.renew(0));
      EXPECT_EQ(holders.fetch_sub(1), 1);
      EXPECT_NO_THROW(link.release(0));
      ++turns[client];
    }
  });
  EXPECT_GT(refusals, 0) << "this was no race";
}

}  // namespace
}  // namespace drivebench::lease_race_test
