#include "clients/link/can/text_bus.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <span>
#include <utility>

#include "clients/link/can/bus_socket.hpp"

namespace drivebench::link {

using namespace std::chrono_literals;

TextBus::TextBus(std::string name, FileDescriptor fd) : name_(std::move(name)), fd_(std::move(fd)) {
  ::fcntl(fd_.get(), F_SETFL, ::fcntl(fd_.get(), F_GETFL) | O_NONBLOCK);
}

std::optional<can::Frame> TextBus::receive(Clock::time_point until) {
  while (frames_.empty()) {
    if (!read_some(until)) return std::nullopt;
  }
  const can::Frame frame = frames_.front();
  frames_.pop_front();
  return frame;
}

void TextBus::write(std::string_view text) {
  const Clock::time_point give_up = Clock::now() + 1s;
  while (!text.empty()) {
    ssize_t sent = ::send(fd_.get(), text.data(), text.size(), MSG_NOSIGNAL);
    if (sent < 0 && errno == ENOTSOCK) sent = ::write(fd_.get(), text.data(), text.size());
    if (sent >= 0) {
      text.remove_prefix(static_cast<std::size_t>(sent));
    } else if (errno == EAGAIN && Clock::now() < give_up) {
      wait_for(POLLOUT, give_up);
    } else if (errno != EINTR) {
      throw LinkError(name_ + " failed: " + reason());
    }
  }
}

bool TextBus::read_some(Clock::time_point until) {
  if (!wait_for(POLLIN, until)) return false;
  std::array<char, 4096> bytes{};
  const ssize_t got = ::read(fd_.get(), bytes.data(), bytes.size());
  if (got == 0 || (got < 0 && errno == EIO)) throw LinkError(name_ + " was closed");
  if (got < 0 && errno != EAGAIN && errno != EINTR) throw LinkError(name_ + " failed: " + reason());
  for (const char byte : std::span(bytes).first(static_cast<std::size_t>(std::max<ssize_t>(got, 0))))
    take(byte);
  return true;
}

bool TextBus::wait_for(short events, Clock::time_point until) {
  std::int64_t left_ms = 0;
  if (until > Clock::time_point::min()) {
    left_ms = std::chrono::ceil<std::chrono::milliseconds>(until - Clock::now()).count();
  }
  pollfd waiting = {.fd = fd_.get(), .events = events, .revents = 0};
  return ::poll(&waiting, 1, static_cast<int>(std::clamp<std::int64_t>(left_ms, 0, 60'000))) > 0;
}

}  // namespace drivebench::link
