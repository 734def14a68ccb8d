#include <deque>
#include <utility>

#include "clients/link/can/can_bus_kind.hpp"
#include "clients/link/can/text_bus.hpp"
#include "clients/link/common/address.hpp"
#include "protocols/can/formats/socketcand.hpp"

namespace drivebench::link {
namespace {

using can::Frame;
using Clock = CanBus::Clock;

class SocketcandBus final : public TextBus {
 public:
  SocketcandBus(const CanAddress& address, std::chrono::milliseconds deadline)
      : TextBus(to_string(address), connect_to(parse_address(address.channel), deadline)) {
    const Clock::time_point give_up = Clock::now() + deadline;
    expect("hi", give_up);
    write("< open " + address.bus + " >");
    expect("ok", give_up);
    write("< rawmode >");
    expect("ok", give_up);
  }

  void send(const Frame& frame) override {
    text_.clear();
    can::append_socketcand_send(text_, frame);
    write(text_);
  }

 private:
  void expect(std::string_view word, Clock::time_point give_up) {
    while (words_.empty()) {
      if (!read_some(give_up) && Clock::now() >= give_up) {
        throw ConnectError(name() + " does not say '" + std::string(word) + "'");
      }
    }
    const std::string said = std::move(words_.front());
    words_.pop_front();
    if (said != word) throw ConnectError(name() + " says '" + said + "', not '" + std::string(word) + "'");
    is_raw_ = word == "ok" && ++answers_ == 2;
  }

  void take(char byte) override {
    const auto element = reader_.push(byte);
    if (!element || element->bad) return;
    if (const auto timed = can::parse_socketcand_frame(element->text)) {
      add(timed->frame);
    } else if (!is_raw_) {
      words_.emplace_back(element->text);
    }
  }

  can::SocketcandReader reader_;
  std::deque<std::string> words_;  // answers to the opening, until all have come
  int answers_ = 0;
  bool is_raw_ = false;
  std::string text_;
};

std::string read_host(std::string_view text, CanAddress& address) {
  if (text.empty()) return "after socketcand: comes HOST:PORT";
  address.channel = text;
  if (text.find(':') == std::string_view::npos) {
    address.channel += ':' + std::to_string(can::row_of(can::Backend::kSocketcand).default_port);
  }
  parse_address(address.channel);  // throws AddressError
  return {};
}

}  // namespace

constinit const CanBusKind kSocketcand = {
    .backend = can::Backend::kSocketcand,
    .read_channel = read_host,
    .open = [](const CanAddress& address, std::chrono::milliseconds deadline, std::span<const std::uint32_t>)
        -> std::unique_ptr<CanBus> { return std::make_unique<SocketcandBus>(address, deadline); }};

}  // namespace drivebench::link
