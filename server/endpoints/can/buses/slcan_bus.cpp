#include "server/endpoints/can/buses/backends.hpp"

#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "protocols/can/formats/slcan.hpp"
#include "server/endpoints/can/buses/slcan_device.hpp"
#include "server/endpoints/can/buses/terminal.hpp"
#include "server/endpoints/can/buses/text_listener.hpp"
#include "server/endpoints/can/buses/text_peer.hpp"
#include "server/endpoints/can/buses/virtual_bus.hpp"

namespace drivebench::can {
namespace {

constexpr std::size_t kMaxClients = 16;
constexpr std::string_view kTcp = "tcp:";
constexpr std::string_view kPty = "pty:";

/// Milliseconds within a minute, like the time stamps of adapters.
std::uint16_t stamp_ms() {
  const auto now = ServerClock::now().time_since_epoch();
  return static_cast<std::uint16_t>(std::chrono::duration_cast<std::chrono::milliseconds>(now).count() %
                                    60'000);
}

/// The serial CAN adapter that a client sees, and the stream to the client.
struct EmulatedAdapter {
  EmulatedAdapter(asio::io_context& io, int fd, BusStatus& status)
      : peer(io, fd, status, [this](std::string& out, const Frame& frame) {
          append_slcan(out, frame, stamped ? std::optional(stamp_ms()) : std::nullopt);
        }) {}

  bool open = false;
  bool listen_only = false;
  bool stamped = false;
  SlcanReader reader;
  TextPeer peer;
};

class SlcanBus final : public VirtualBus {
 public:
  SlcanBus(asio::io_context& io, const CanConfig& config)
      : VirtualBus(io, config), listener_(io), terminal_(io) {
    listener_.on_client = [this](int fd) { welcome(fd); };
    terminal_.on_client = [this](int fd) { welcome(fd); };
  }

  void send(const Frame& frame) override { broadcast(frame, nullptr); }
  std::string name() const override { return "slcan:" + name_; }

 private:
  std::string open() override;
  void welcome(int fd);
  void part(const EmulatedAdapter* adapter);
  void broadcast(const Frame& frame, const EmulatedAdapter* except);
  void take(EmulatedAdapter& adapter, const SlcanReader::Line& line);
  std::string answer(EmulatedAdapter& adapter, std::string_view line);

  bool is_tcp() const { return config_.channel.starts_with(kTcp); }

  std::string name_ = config_.channel;
  TextListener listener_;
  Terminal terminal_;
  std::vector<std::unique_ptr<EmulatedAdapter>> adapters_;
};

std::string SlcanBus::open() {
  const std::string where = config_.channel.substr(kTcp.size());  // both prefixes have this length
  if (!is_tcp()) return terminal_.open(where);
  HostPort parsed;
  std::string problem = parse_host_port(where, parsed);
  if (problem.empty()) problem = listener_.open(parsed);
  if (problem.empty())
    name_ = config_.channel.substr(0, config_.channel.rfind(':') + 1) + std::to_string(listener_.port());
  return problem;
}

void SlcanBus::welcome(int fd) {
  if (adapters_.size() == kMaxClients) {
    refused(peer_of(fd), "there are as many clients as this bus serves");
    ::close(fd);
    return;
  }
  adapters_.push_back(std::make_unique<EmulatedAdapter>(io_, fd, status_));
  EmulatedAdapter* adapter = adapters_.back().get();
  adapter->peer.on_bytes = [this, adapter](std::string_view bytes) {
    for (const char byte : bytes) {
      if (const auto line = adapter->reader.push(byte)) take(*adapter, *line);
    }
  };
  adapter->peer.on_end = [this, adapter] { part(adapter); };
  adapter->peer.start();
}

void SlcanBus::part(const EmulatedAdapter* adapter) {
  std::erase_if(adapters_, [adapter](const auto& each) { return each.get() == adapter; });
  if (!is_tcp()) terminal_.release();
}

void SlcanBus::broadcast(const Frame& frame, const EmulatedAdapter* except) {
  for (const auto& adapter : adapters_) {
    if (adapter->open && adapter.get() != except) adapter->peer.send(frame);
  }
}

void SlcanBus::take(EmulatedAdapter& adapter, const SlcanReader::Line& line) {
  if (line.refusal) return;  // a BELL from a client has no meaning
  const auto frame = line.too_long ? std::nullopt : parse_slcan(line.text);
  const bool may_send = adapter.open && !adapter.listen_only;
  // A client that never reads loses its answers.
  if (line.too_long) {
    ++status_.malformed;
    adapter.peer.answer({&kSlcanRefused, 1});
  } else if (!frame) {
    adapter.peer.answer(answer(adapter, line.text));
  } else {
    adapter.peer.answer({may_send ? &kSlcanOk : &kSlcanRefused, 1});
  }
  if (!frame || !may_send) return;
  broadcast(*frame, &adapter);
  deliver(*frame, 0);
}

/// The answer to a command. Bit rates are accepted without effect.
std::string SlcanBus::answer(EmulatedAdapter& adapter, std::string_view line) {
  static const std::string kYes(1, kSlcanOk);
  static const std::string kNo(1, kSlcanRefused);
  if (line.empty()) return kYes;
  const std::string_view argument = line.substr(1);
  const auto is_digits = [&](std::size_t least, std::size_t most) {
    return argument.size() >= least && argument.size() <= most &&
           std::ranges::all_of(argument, [](unsigned char c) { return std::isxdigit(c) != 0; });
  };
  switch (line.front()) {
    case 'O':
    case 'L':
      if (adapter.open || !argument.empty()) return kNo;
      adapter.open = true;
      adapter.listen_only = line.front() == 'L';
      return kYes;
    case 'C':
      if (!adapter.open || !argument.empty()) return kNo;
      adapter.open = false;
      adapter.peer.forget_frames();
      return kYes;
    case 'S':
    case 'Y':
      return !adapter.open && is_digits(1, 1) ? kYes : kNo;
    case 's':
      return !adapter.open && is_digits(4, 8) ? kYes : kNo;
    case 'Z':
      if (adapter.open || (argument != "0" && argument != "1")) return kNo;
      adapter.stamped = argument == "1";
      return kYes;
    case 'F':
      return adapter.open && argument.empty() ? "F00" + kYes : kNo;
    case 'V':
      return argument.empty() ? "V0101" + kYes : kNo;
    case 'N':
      return argument.empty() ? "NDB01" + kYes : kNo;
    default:
      ++status_.malformed;
      return kNo;
  }
}

}  // namespace

std::unique_ptr<Bus> make_slcan_bus(asio::io_context& io, const CanConfig& config) {
  if (!config.channel.starts_with(kTcp) && !config.channel.starts_with(kPty))
    return make_slcan_device(io, config);
  auto bus = std::make_unique<SlcanBus>(io, config);
  bus->start();
  return bus;
}

}  // namespace drivebench::can
