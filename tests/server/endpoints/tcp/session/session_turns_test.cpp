#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <string>
#include <vector>

#include "bench.pb.h"
#include "protocols/framing.hpp"
#include "server/endpoints/tcp/stream_server.hpp"
#include "tests/server/recording/run_config.hpp"

namespace drivebench::session_turns_test {
namespace {

/// A client on a socket of its own, which does not wait for answers.
class Peer {
 public:
  Peer(asio::io_context& io, const StreamServer& server) : socket_(io) {
    const std::string address = server.tcp_address();
    const auto port = static_cast<std::uint16_t>(std::stoi(address.substr(address.rfind(':') + 1)));
    socket_.connect({asio::ip::make_address("127.0.0.1"), port});
    socket_.non_blocking(true);
    v1::Envelope hello;
    hello.mutable_hello()->set_protocol_min(1);
    hello.mutable_hello()->set_protocol_max(1);
    add(hello);
    send();
  }
  void add(const v1::Envelope& request) {
    const std::string payload = request.SerializeAsString();
    for (const std::byte byte : frame_header(static_cast<std::uint32_t>(payload.size())))
      waiting_ += static_cast<char>(byte);
    waiting_ += payload;
  }
  void send() {
    const std::string bytes = std::exchange(waiting_, {});
    EXPECT_EQ(socket_.send(asio::buffer(bytes)), bytes.size());
  }

  /// The answers that have arrived.
  std::vector<v1::Envelope> answers() {
    std::vector<v1::Envelope> found;
    boost::system::error_code error;
    while (!error) {
      const std::span<std::byte> space = reader_.free_space();
      reader_.received(socket_.read_some(asio::buffer(space.data(), space.size()), error));
      while (const auto frame = reader_.next())
        EXPECT_TRUE(found.emplace_back().ParseFromArray(frame->data(), static_cast<int>(frame->size())));
    }
    return found;
  }

 private:
  asio::ip::tcp::socket socket_;
  std::string waiting_;
  FrameReader reader_{kMaxReplyFrame};
};

TcpConfig any_port() {
  TcpConfig config;
  config.port = 0;
  return config;
}

class SessionTurns : public ::testing::Test {
 protected:
  SessionTurns() {
    server_.serve(
        *engine_, [] { return std::vector<TransportReport>(); }, nullptr);
  }
  Peer greeted() {
    Peer peer(io_, server_);
    while (peer.answers().empty())
      io_.run_one();
    return peer;
  }

  asio::io_context io_{1};
  std::unique_ptr<Engine> engine_ = make_lockstep_engine(servo_bench());
  StreamServer server_{io_, any_port()};
};

// Catches: a viewer that asks for everything a thousand times at once, and a controller that waits for all of
// these answers.
TEST_F(SessionTurns, TCP_11_ASessionThatAsksForMuchDoesNotDelayTheOthers) {
  Peer greedy = greeted();
  Peer modest = greeted();
  v1::Envelope everything;
  everything.mutable_read_parameters();
  for (int i = 0; i < 40; ++i)
    greedy.add(everything);
  greedy.send();
  v1::Envelope status;
  status.mutable_status_request();
  modest.add(status);
  modest.send();
  std::size_t before = 0;
  while (modest.answers().empty()) {
    io_.run_one();
    before += greedy.answers().size();
  }
  EXPECT_LE(before, 5u);
  for (std::size_t all = before; all < 40; all += greedy.answers().size())
    io_.run_one();
}

// Catches: an answer that grows with the list of names; a request of 64 KiB holds five thousand of them.
TEST_F(SessionTurns, TCP_05_ParametersAreDescribedOnceEach) {
  Peer peer = greeted();
  v1::Envelope request;
  for (int i = 0; i < 1000; ++i)
    request.mutable_read_parameters()->add_names("drive.kind");
  peer.add(request);
  peer.send();
  std::vector<v1::Envelope> answers;
  while ((answers = peer.answers()).empty())
    io_.run_one();
  EXPECT_EQ(answers[0].refusal().code(), v1::REFUSAL_OUT_OF_RANGE);
  EXPECT_EQ(answers[0].refusal().field(), "names");
}

}  // namespace
}  // namespace drivebench::session_turns_test
