#include <fcntl.h>
#include <termios.h>

#include "clients/link/can/bus_socket.hpp"
#include "clients/link/can/can_bus_kind.hpp"
#include "clients/link/can/text_bus.hpp"
#include "protocols/can/formats/slcan.hpp"

namespace drivebench::link {
namespace {

using can::Frame;

FileDescriptor open_slcan(const CanAddress& address, std::chrono::milliseconds deadline) {
  if (address.channel.starts_with("tcp:")) return connect_to(parse_address(address.channel), deadline);
  FileDescriptor fd(::open(address.channel.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  termios mode = {};
  if (!fd.is_open() || ::tcgetattr(fd.get(), &mode) != 0) {
    throw ConnectError("there is no terminal " + address.channel + ": " + reason());
  }
  ::cfmakeraw(&mode);
  ::tcsetattr(fd.get(), TCSANOW, &mode);
  return fd;
}

class SlcanBus final : public TextBus {
 public:
  SlcanBus(const CanAddress& address, std::chrono::milliseconds deadline)
      : TextBus(to_string(address), open_slcan(address, deadline)) {
    // Does not wait for answers: the other end of a pseudo terminal may send none.
    write("\rC\r" + std::string(*can::slcan_bit_rate(address.bit_rate)) + "\r" +
          (address.profile.fd ? std::string(*can::slcan_data_bit_rate(address.data_bit_rate)) + "\r" : "") +
          "O\r");
  }

  void send(const Frame& frame) override {
    text_.clear();
    can::append_slcan(text_, frame);
    write(text_);
  }

 private:
  void take(char byte) override {
    const auto line = reader_.push(byte);
    if (!line || line->refusal || line->too_long) return;
    if (const auto frame = can::parse_slcan(line->text)) add(*frame);
  }

  can::SlcanReader reader_;
  std::string text_;
};

std::string read_terminal(std::string_view text, CanAddress& address) {
  if (text.starts_with("tcp:")) {
    parse_address(text);  // throws AddressError
  } else if (!text.starts_with('/')) {
    return "after slcan: comes tcp:HOST:PORT or the path of a terminal";
  }
  address.channel = text;
  return {};
}

}  // namespace

constinit const CanBusKind kSlcan = {.backend = can::Backend::kSlcan,
                                     .read_channel = read_terminal,
                                     .open = [](const CanAddress& address, std::chrono::milliseconds deadline,
                                                std::span<const std::uint32_t>) -> std::unique_ptr<CanBus> {
                                       return std::make_unique<SlcanBus>(address, deadline);
                                     }};

}  // namespace drivebench::link
