#include "server/endpoints/can/buses/slcan_device.hpp"

#include <fcntl.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <optional>

#include "protocols/can/formats/slcan.hpp"
#include "protocols/can/formats/text.hpp"
#include "server/endpoints/can/buses/text_peer.hpp"
#include "server/endpoints/can/buses/virtual_bus.hpp"
#include "server/endpoints/log_limit.hpp"
#include "server/host/logging/log.hpp"

namespace drivebench::can {
namespace {

using Clock = ServerClock;

// An adapter may refuse to close a channel that is not open.
constexpr auto kHandshake = std::chrono::milliseconds(500);

struct Baud {
  std::uint32_t baud;
  speed_t code;
};
constexpr std::array<Baud, 13> kBauds{{{9600, B9600},
                                       {19200, B19200},
                                       {38400, B38400},
                                       {57600, B57600},
                                       {115200, B115200},
                                       {230400, B230400},
                                       {460800, B460800},
                                       {500000, B500000},
                                       {921600, B921600},
                                       {1000000, B1000000},
                                       {2000000, B2000000},
                                       {3000000, B3000000},
                                       {4000000, B4000000}}};

class SlcanDevice final : public VirtualBus {
 public:
  using VirtualBus::VirtualBus;

  void send(const Frame& frame) override;
  std::string name() const override { return "slcan:" + config_.channel; }

 private:
  std::string open() override;
  std::string open_line(int& fd);
  std::string handshake(std::string& out) const;
  void take(std::string_view bytes);
  void take_line(const SlcanReader::Line& line);

  std::optional<TextPeer> peer_;
  SlcanReader reader_;
  Clock::time_point opened_{};
  LogLimit refusal_log_;
};

void SlcanDevice::send(const Frame& frame) {
  if (peer_) {
    peer_->send(frame);
  } else {
    ++status_.send_dropped;
  }
}

std::string SlcanDevice::open() {
  std::string greeting;
  int fd = -1;
  std::string problem = handshake(greeting);
  if (problem.empty()) problem = open_line(fd);
  if (!problem.empty()) return problem;
  peer_.emplace(io_, fd, status_, [](std::string& out, const Frame& frame) { append_slcan(out, frame); });
  peer_->on_bytes = [this](std::string_view bytes) { take(bytes); };
  peer_->on_end = [this] {
    peer_.reset();
    lost("the device is gone");
  };
  reader_ = {};
  opened_ = Clock::now();
  peer_->start();
  peer_->answer(greeting);
  return {};
}

/// Opens the device raw and for this process alone.
std::string SlcanDevice::open_line(int& fd) {
  const std::size_t at = config_.channel.rfind('@');
  const std::string path = config_.channel.substr(0, at);
  std::uint32_t baud = 115200;
  if (at != std::string::npos)
    baud = parse_number(std::string_view(config_.channel).substr(at + 1), 10).value_or(0);
  const auto row = std::ranges::find(kBauds, baud, &Baud::baud);
  if (row == kBauds.end()) return "serial lines do not have this baud rate: write PATH@115200, for example";
  fd = ::open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0) return reason() + (errno == EACCES ? " (join the group that owns it, often dialout)" : "");
  termios line{};
  const bool is_line = ::tcgetattr(fd, &line) == 0;
  ::cfmakeraw(&line);
  line.c_cflag |= CLOCAL | CREAD;
  line.c_cflag &= ~CRTSCTS;
  if (is_line && ::cfsetspeed(&line, row->code) == 0 && ::tcsetattr(fd, TCSANOW, &line) == 0 &&
      ::ioctl(fd, TIOCEXCL) == 0 && ::tcflush(fd, TCIOFLUSH) == 0)
    return {};
  std::string problem = is_line ? reason() : "it is not a serial device";
  ::close(fd);
  return problem;
}

/// The lines that open the channel: end an unfinished line, close, set the bit rates, open.
std::string SlcanDevice::handshake(std::string& out) const {
  const auto rate = slcan_bit_rate(config_.bit_rate);
  if (!rate) return "slcan adapters do not know bit_rate " + std::to_string(config_.bit_rate);
  out = "\r\r\rC\r" + std::string(*rate) + "\r";
  if (config_.profile.fd) {
    const auto data_rate = slcan_data_bit_rate(config_.data_bit_rate);
    if (!data_rate)
      return "slcan adapters do not know data_bit_rate " + std::to_string(config_.data_bit_rate);
    out += std::string(*data_rate) + "\r";
  }
  out += "O\r";
  return {};
}

void SlcanDevice::take(std::string_view bytes) {
  for (const char byte : bytes) {
    if (const auto line = reader_.push(byte)) take_line(*line);
  }
}

void SlcanDevice::take_line(const SlcanReader::Line& line) {
  if (line.refusal) {
    if (Clock::now() - opened_ < kHandshake) return;
    ++status_.send_dropped;
    if (refusal_log_.allow()) log::warn("{}: the adapter refuses what it is sent", name());
    return;
  }
  if (const auto frame = line.too_long ? std::nullopt : parse_slcan(line.text)) {
    deliver(*frame, 0);
  } else if (line.too_long || !(line.text.empty() || line.text == "z" || line.text == "Z")) {
    ++status_.malformed;  // z and Z say that a frame was sent
  }
}

}  // namespace

std::unique_ptr<Bus> make_slcan_device(asio::io_context& io, const CanConfig& config) {
  auto bus = std::make_unique<SlcanDevice>(io, config);
  bus->start();
  return bus;
}

}  // namespace drivebench::can
