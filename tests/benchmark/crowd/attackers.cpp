#include "tests/benchmark/crowd/attackers.hpp"

#include <sys/socket.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <exception>
#include <memory>
#include <utility>
#include <vector>

#include "bench.pb.h"
#include "clients/link/common/address.hpp"
#include "protocols/framing.hpp"
#include "tests/benchmark/harness/machine.hpp"
#include "tests/fuzz/request_program.hpp"

namespace drivebench::speed {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t kSessions = 64;
constexpr std::size_t kAtTheDoor = 100;

std::string framed(const std::string& content) {
  const auto header = frame_header(static_cast<std::uint32_t>(content.size()));
  return std::string(reinterpret_cast<const char*>(header.data()), header.size()) + content;
}

std::string hello(const std::string& token) {
  v1::Envelope envelope;
  envelope.set_id(1);
  envelope.mutable_hello()->set_protocol_min(1);
  envelope.mutable_hello()->set_protocol_max(1);
  envelope.mutable_hello()->set_client("an attacker");
  envelope.mutable_hello()->set_token(token);
  return framed(envelope.SerializeAsString());
}

/// A connection that first sends a greeting, then the same bytes again and again, and reads what it gets.
class Sender {
 public:
  Sender(std::string greeting, std::string again)
      : greeting_(std::move(greeting)), again_(std::move(again)) {}

  /// Sends what the server takes now; connects anew if it has closed the connection.
  void go_on(const link::Address& address) {
    if (!socket_.is_open()) {
      socket_ = link::connect_to(address, 5s);
      sent_ = 0;
    }
    if (is_over() || !send()) socket_.close();
  }

 private:
  bool is_over() {
    std::array<char, 65536> answers;
    ssize_t count = 0;
    do {
      count = ::recv(socket_.get(), answers.data(), answers.size(), MSG_DONTWAIT);
    } while (count > 0);
    return count == 0 || errno != EAGAIN;
  }

  bool send() {
    const bool greets = sent_ < greeting_.size();
    if (!greets && again_.empty()) return true;
    const std::string& bytes = greets ? greeting_ : again_;
    const std::size_t from = greets ? sent_ : (sent_ - greeting_.size()) % again_.size();
    const ssize_t count =
        ::send(socket_.get(), bytes.data() + from, bytes.size() - from, MSG_DONTWAIT | MSG_NOSIGNAL);
    if (count > 0) sent_ += static_cast<std::size_t>(count);
    return count > 0 || errno == EAGAIN;
  }

  std::string greeting_;
  std::string again_;
  link::FileDescriptor socket_;
  std::size_t sent_ = 0;
};

Attackers::Round round_of(const std::string& address, std::size_t count, const std::string& greeting,
                          const std::string& again) {
  // Shared, because a Round is copied.
  auto senders = std::make_shared<std::vector<std::unique_ptr<Sender>>>();
  for (std::size_t n = 0; n < count; ++n)
    senders->push_back(std::make_unique<Sender>(greeting, again));
  return [senders, to = link::parse_address(address)] {
    for (const auto& sender : *senders)
      sender->go_on(to);
  };
}

}  // namespace

Attackers::Attackers(Round round) {
  thread_ = std::thread([this, round = std::move(round)] {
    give_way();
    while (!stop_.load()) {
      try {
        round();
      } catch (const std::exception&) {
        // The server takes no connection now: the next round asks again.
      }
      std::this_thread::sleep_for(100us);
    }
  });
}

Attackers::~Attackers() {
  stop_.store(true);
  thread_.join();
}

Attackers::Round large_frames(const std::string& address, const std::string& token) {
  const std::string empty = fuzz::wire::tagged(3, 2, "");
  const std::string samples =
      fuzz::wire::tagged(v1::Envelope::kSamples, 2, fuzz::wire::repeated(empty, 32'000));
  return round_of(address, kSessions, hello(token), framed(samples));
}

Attackers::Round crowd_at_the_door(const std::string& address) {
  return round_of(address, kAtTheDoor, "", "");
}

Attackers::Round wrong_tokens(const std::string& address) {
  return round_of(address, kSessions, hello("a guess"), "");
}

Attackers::Round forbidden_requests(const std::string& address, const std::string& token) {
  v1::Envelope envelope;
  envelope.set_id(2);
  envelope.mutable_exchange()->add_commands();
  return round_of(address, kSessions, hello(token), framed(envelope.SerializeAsString()));
}

}  // namespace drivebench::speed
