#include "server/endpoints/can/buses/backends.hpp"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "protocols/can/formats/socketcand.hpp"
#include "protocols/can/formats/text.hpp"
#include "server/endpoints/can/buses/text_listener.hpp"
#include "server/endpoints/can/buses/text_peer.hpp"
#include "server/endpoints/can/buses/virtual_bus.hpp"

namespace drivebench::can {
namespace {

constexpr std::size_t kMaxSocketcandClients = 64;
constexpr std::size_t kMaxNameLength = 16;
constexpr auto kStallLimit = std::chrono::seconds(2);
constexpr std::string_view kOk = "< ok >";

/// Before open; after it; frames flow; statistics flow.
enum class Mode : std::uint8_t { kNoBus, kOpen, kRaw, kControl };

std::size_t data_size(const Frame& frame) {
  return frame.remote ? 0 : frame.size;
}

/// python-can 4.1.0 loses the first character of the rest of its buffer if the buffer ends inside an element.
/// So each frame begins with a blank, which readers skip.
void append_with_blank(std::string& out, const Frame& frame) {
  out += ' ';
  append_socketcand_frame(out, frame, realtime_s());
}

struct SocketcandClient : std::enable_shared_from_this<SocketcandClient> {
  SocketcandClient(asio::io_context& io, int fd, BusStatus& status)
      : peer(io, fd, status, append_with_blank), statistics(io) {}

  /// Sends an answer; cuts off a client that does not read its answers.
  void answer(std::string_view text) {
    if (peer.answer(text)) return;
    peer.on_stall();
    peer.end();
  }

  Mode mode = Mode::kNoBus;
  SocketcandReader reader;
  TextPeer peer;
  ServerTimer statistics;
};

class SocketcandBus final : public VirtualBus {
 public:
  SocketcandBus(asio::io_context& io, const CanConfig& config) : VirtualBus(io, config), listener_(io) {
    listener_.on_client = [this](int fd) { welcome(fd); };
  }

  void send(const Frame& frame) override { broadcast(frame, nullptr); }
  std::string name() const override {
    const std::string port = std::to_string(config_.port);
    const bool is_v6 = config_.channel.find(':') != std::string::npos;
    return "socketcand:" + (is_v6 ? "[" + config_.channel + "]" : config_.channel) + ":" + port;
  }

 private:
  std::string open() override;
  void welcome(int fd);
  void broadcast(const Frame& frame, const SocketcandClient* except);
  void take(SocketcandClient& client, const SocketcandReader::Element& element);
  void take_before_open(SocketcandClient& client, std::string_view word, std::string_view rest);
  bool change_mode(SocketcandClient& client, std::string_view word);
  void take_frame(SocketcandClient& client, std::string_view element);
  void start_statistics(SocketcandClient& client, std::string_view period);
  void send_statistics(SocketcandClient& client, std::chrono::milliseconds period);

  TextListener listener_;
  std::vector<std::shared_ptr<SocketcandClient>> clients_;
  std::uint64_t bytes_received_ = 0;  ///< of frames
  std::uint64_t bytes_sent_ = 0;
  std::uint64_t frames_sent_ = 0;
};

std::string SocketcandBus::open() {
  if (!is_address(config_.channel)) return "the channel must be an address to listen on, such as 127.0.0.1";
  std::string problem = listener_.open({config_.channel, config_.port});
  if (problem.empty()) config_.port = listener_.port();
  return problem;
}

void SocketcandBus::welcome(int fd) {
  if (clients_.size() == kMaxSocketcandClients) {
    refused(peer_of(fd), "there are as many clients as this bus serves");
    ::close(fd);
    return;
  }
  clients_.push_back(std::make_shared<SocketcandClient>(io_, fd, status_));
  SocketcandClient* client = clients_.back().get();
  client->peer.set_stall_limit(kStallLimit);
  client->peer.on_bytes = [this, client](std::string_view bytes) {
    for (const char byte : bytes) {
      if (const auto element = client->reader.push(byte)) take(*client, *element);
    }
  };
  client->peer.on_stall = [this, peer = peer_of(fd)] { refused(peer, "it does not read what it is sent"); };
  client->peer.on_end = [this, client] {
    std::erase_if(clients_, [client](const auto& each) { return each.get() == client; });
  };
  client->peer.start();
  client->answer("< hi >");
}

void SocketcandBus::broadcast(const Frame& frame, const SocketcandClient* except) {
  for (const auto& client : clients_) {
    if (client->mode == Mode::kRaw && client.get() != except) client->peer.send(frame);
  }
  if (except != nullptr) return;
  ++frames_sent_;
  bytes_sent_ += data_size(frame);
}

void SocketcandBus::take(SocketcandClient& client, const SocketcandReader::Element& element) {
  std::string_view rest = element.text;
  const std::string_view word = take_word(rest);
  const auto refuse = [&] {
    ++status_.malformed;
    client.answer("< error unknown command >");
  };
  if (element.bad) return refuse();
  if (client.mode == Mode::kNoBus) {
    take_before_open(client, word, rest);
  } else if (word == "echo") {
    client.answer("< echo >");
  } else if (change_mode(client, word)) {
    client.answer(kOk);
  } else if (word == "send" || word == "sendrtr" || word == "fdsend") {
    take_frame(client, element.text);
  } else if (word == "statistics" && client.mode == Mode::kControl) {
    start_statistics(client, take_word(rest));
  } else {
    refuse();
  }
}

void SocketcandBus::take_before_open(SocketcandClient& client, std::string_view word, std::string_view rest) {
  const std::string_view bus = take_word(rest);
  if (word == "open" && !bus.empty() && bus.size() <= kMaxNameLength && take_word(rest).empty()) {
    client.mode = Mode::kOpen;
    client.answer(kOk);
  } else {
    ++status_.malformed;
    client.answer("< error no bus is open >");
    client.peer.end();
  }
}

bool SocketcandBus::change_mode(SocketcandClient& client, std::string_view word) {
  Mode mode{};
  if (word == "rawmode") {
    mode = Mode::kRaw;
  } else if (word == "bcmmode") {
    mode = Mode::kOpen;
  } else if (word == "controlmode") {
    mode = Mode::kControl;
  } else {
    return false;
  }
  if (mode != Mode::kRaw) client.peer.forget_frames();
  client.mode = mode;
  client.statistics.cancel();
  return true;
}

void SocketcandBus::take_frame(SocketcandClient& client, std::string_view element) {
  const auto frame = parse_socketcand_send(element);
  if (!frame) {
    ++status_.malformed;
    return client.answer("< error this is no frame >");
  }
  bytes_received_ += data_size(*frame);
  broadcast(*frame, &client);
  deliver(*frame, 0);
}

void SocketcandBus::start_statistics(SocketcandClient& client, std::string_view period) {
  const auto period_ms = parse_number(period, 10);
  client.statistics.cancel();
  if (!period_ms) return client.answer("< error unknown command >");
  if (*period_ms != 0) send_statistics(client, std::chrono::milliseconds(std::max(*period_ms, 10u)));
}

void SocketcandBus::send_statistics(SocketcandClient& client, std::chrono::milliseconds period) {
  client.answer("< stat " + std::to_string(bytes_received_) + " " + std::to_string(status_.received) + " " +
                std::to_string(bytes_sent_) + " " + std::to_string(frames_sent_) + " >");
  client.statistics.expires_after(period);
  client.statistics.async_wait(
      [this, period, weak = client.weak_from_this()](const boost::system::error_code& error) {
        const auto alive = weak.lock();
        if (alive && !error && alive->mode == Mode::kControl) send_statistics(*alive, period);
      });
}

}  // namespace

std::unique_ptr<Bus> make_socketcand_bus(asio::io_context& io, const CanConfig& config) {
  auto bus = std::make_unique<SocketcandBus>(io, config);
  bus->start();
  return bus;
}

}  // namespace drivebench::can
