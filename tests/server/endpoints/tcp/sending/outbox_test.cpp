#include "server/endpoints/tcp/sending/outbox.hpp"

#include <gtest/gtest.h>
#include <linux/sockios.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <memory>
#include <string>
#include <vector>

#include "tests/server/endpoints/simulated_clock.hpp"

namespace drivebench::outbox_test {
namespace {

using namespace std::chrono_literals;

/// An outbox and its peer, which reads when told to.
class Pair {
 public:
  explicit Pair(const std::shared_ptr<OutboxPool>& pool)
      : socket_(io_, asio::generic::stream_protocol(AF_UNIX, 0)), outbox(socket_, pool) {
    boost::system::error_code ignored;
    socket_.close(ignored);
    std::array<int, 2> ends{};
    EXPECT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()), 0);
    socket_.assign(asio::generic::stream_protocol(AF_UNIX, 0), ends[0]);
    socket_.non_blocking(true);
    peer_ = ends[1];
    outbox.on_cut = [this](std::string_view why) { cut = why; };
  }
  ~Pair() {
    outbox.close();
    io_.poll();
    ::close(peer_);
  }
  Pair(const Pair&) = delete;
  Pair& operator=(const Pair&) = delete;

  void send(std::size_t count) {
    std::vector<std::byte> bytes(count);
    for (std::byte& byte : bytes)
      byte = static_cast<std::byte>(sent_++ % 251);
    outbox.send(bytes, owner_);
    settle();
  }
  /// Bytes that neither the peer nor the kernel has.
  std::size_t waiting() const {
    int in_kernel = 0;
    ::ioctl(peer_, SIOCINQ, &in_kernel);
    return sent_ - received_ - static_cast<std::size_t>(in_kernel);
  }
  /// Lets the peer read until nothing comes; whether it got the bytes that were sent.
  bool read_all() {
    while (read_what_is_there())
      settle();
    return intact_;
  }
  /// While the outbox does nothing. False: there was nothing.
  bool read_what_is_there() {
    std::array<unsigned char, 65'536> bytes;
    const std::size_t before = received_;
    ssize_t count = 0;
    while ((count = ::recv(peer_, bytes.data(), bytes.size(), MSG_DONTWAIT)) > 0) {
      for (ssize_t i = 0; i < count; ++i)
        intact_ = intact_ && bytes[static_cast<std::size_t>(i)] == received_++ % 251;
    }
    return received_ > before;
  }
  void settle() {
    io_.restart();
    io_.poll();
  }

  asio::io_context io_{1};
  Outbox::Socket socket_;
  Outbox outbox;
  std::string cut;

 private:
  int peer_ = -1;
  std::size_t sent_ = 0;
  std::size_t received_ = 0;
  bool intact_ = true;
  std::shared_ptr<void> owner_ = std::make_shared<int>();
};

// Catches: a limit that does not count the piece under way, so that twice as much waits; a limit that cuts a
// byte too early; queued bytes that leave out of order.
TEST(Outbox, LIMIT_03_AMebibyteMayWaitAndNotAByteMore) {
  for (const bool one_too_many : {false, true}) {
    const auto pool = std::make_shared<OutboxPool>();
    Pair pair(pool);
    pair.send(700'000);  // more than the kernel takes
    ASSERT_GT(pair.waiting(), 0u);
    while (Outbox::kMaxQueued - pair.waiting() > 100'000)
      pair.send(100'000);
    ASSERT_EQ(pair.cut, "");
    pair.send(Outbox::kMaxQueued - pair.waiting());
    EXPECT_EQ(pair.waiting(), Outbox::kMaxQueued);
    EXPECT_EQ(pair.cut, "") << "a mebibyte may wait";
    if (one_too_many) {
      pair.send(1);
      EXPECT_EQ(pair.cut, "too much waits for it");
      EXPECT_FALSE(pair.socket_.is_open());
    } else {
      EXPECT_FALSE(pair.outbox.idle());
      EXPECT_TRUE(pair.read_all());
      EXPECT_EQ(pair.waiting(), 0u);
      EXPECT_TRUE(pair.outbox.idle());
    }
  }
}

// Catches: memory that grows with the number of peers that do not read; a share that is not given back; many
// peers that leave nothing to the last one.
TEST(Outbox, OS_11_ManyPeersThatDoNotReadGetLittleEach) {
  const auto pool = std::make_shared<OutboxPool>();
  std::vector<std::unique_ptr<Pair>> deaf;
  std::size_t most = 0;
  for (int n = 0; n < 100; ++n) {
    deaf.push_back(std::make_unique<Pair>(pool));
    Pair& pair = *deaf.back();
    pair.send(400'000);  // more than the kernel takes
    while (pair.cut.empty() && pair.waiting() < Outbox::kMaxQueued - 10'000) {
      most = std::max(most, pool->bytes);
      pair.send(10'000);
    }
  }
  EXPECT_LE(most, OutboxPool::kMaxBytes + 100 * Outbox::kAlwaysQueued);
  EXPECT_GT(most, OutboxPool::kMaxBytes / 2);
  EXPECT_FALSE(deaf.back()->cut.empty());
  Pair modest(pool);
  while (modest.waiting() < Outbox::kAlwaysQueued - 10'000)
    modest.send(10'000);
  EXPECT_EQ(modest.cut, "") << "there is always room for an answer";
  deaf.clear();
  EXPECT_EQ(pool->bytes, modest.waiting());
}

// Catches: a limit that ends a peer although its bytes have arrived in the same turn, as after a pause of the
// process.
TEST(Outbox, LIMIT_04_APeerThatReadDuringAPauseStays) {
  for (const std::chrono::milliseconds pause : {2001ms, 3000ms}) {
    SimulatedClock clock;
    Pair pair(std::make_shared<OutboxPool>());
    pair.send(700'000);  // more than the kernel takes
    ASSERT_GT(pair.waiting(), 0u);
    pair.read_what_is_there();
    clock.pass(pair.io_, pause);
    pair.settle();
    EXPECT_EQ(pair.cut, "");
    EXPECT_TRUE(pair.read_all());
    EXPECT_EQ(pair.waiting(), 0u);
  }
}

// Catches: a pause of the process that counts as silence of the peer, although the server has not yet looked
// at what the peer has read meanwhile.
TEST(Outbox, LIMIT_04_APauseOfTheServerIsNoSilenceOfThePeer) {
  SimulatedClock clock;
  Pair pair(std::make_shared<OutboxPool>());
  pair.send(700'000);
  ASSERT_GT(pair.waiting(), 0u);
  clock.pass(pair.io_, 3s);
  pair.settle();
  EXPECT_EQ(pair.cut, "") << "a second of it was beyond the limit";
  clock.pass(pair.io_, 999ms);
  pair.settle();
  EXPECT_EQ(pair.cut, "");
  clock.pass(pair.io_, 2ms);
  pair.settle();
  EXPECT_EQ(pair.cut, "it took nothing for 2 s");
}

}  // namespace
}  // namespace drivebench::outbox_test
