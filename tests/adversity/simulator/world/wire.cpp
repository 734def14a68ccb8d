#include "tests/adversity/simulator/world/wire.hpp"

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

namespace drivebench::simulator {

void Wire::send(std::string bytes) {
  while (!bytes.empty()) {
    const std::size_t size = random_.chance(quality_.torn)
                                 ? static_cast<std::size_t>(1 + random_.below(bytes.size()))
                                 : bytes.size();
    const Time jitter = quality_.jitter > 0 ? random_.between(0, quality_.jitter) : 0;
    last_arrival_ = std::max(last_arrival_, schedule_.now() + quality_.delay + jitter);
    under_way_.push_back({.arrival = last_arrival_, .bytes = bytes.substr(0, size)});
    bytes.erase(0, size);
  }
  deliver();
}

void Wire::deliver() {
  const Time now = schedule_.now();
  while (!under_way_.empty() && socket_ >= 0 && now >= stopped_until_ && under_way_.front().arrival <= now) {
    std::string& bytes = under_way_.front().bytes;
    const ssize_t sent = ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    if (sent < 0 && errno != EAGAIN) return cut();
    bytes.erase(0, static_cast<std::size_t>(std::max<ssize_t>(sent, 0)));
    if (!bytes.empty()) break;  // the server's buffer is full
    under_way_.pop_front();
  }
  if (under_way_.empty() || socket_ < 0 || delivering_) return;
  delivering_ = true;
  const Time soon = now + kMillisecond / 2;
  const Time due = std::max(under_way_.front().arrival, stopped_until_);
  schedule_.at(due > now ? due : soon, [wire = weak_from_this()] {
    if (const auto self = wire.lock()) {
      self->delivering_ = false;
      self->deliver();
    }
  });
}

std::span<const std::byte> Wire::receive(std::size_t most) {
  static std::array<std::byte, 65536> buffer;
  if (socket_ < 0 || schedule_.now() < stopped_until_) return {};
  const ssize_t count = ::recv(socket_, buffer.data(), std::min(most, buffer.size()), MSG_DONTWAIT);
  if (count > 0) return std::span<const std::byte>(buffer).first(static_cast<std::size_t>(count));
  if (count == 0 || errno != EAGAIN) cut();
  return {};
}

bool Wire::is_connected() const {
  if (socket_ < 0) return false;
  pollfd end{.fd = socket_, .events = POLLRDHUP, .revents = 0};
  return ::poll(&end, 1, 0) == 0;
}

void Wire::heal() {
  quality_ = {};
  stopped_until_ = 0;
  delivering_ = false;  // the scheduled delivery is for the end of the stop
  deliver();
}

void Wire::cut() {
  if (socket_ >= 0) ::close(std::exchange(socket_, -1));
  under_way_.clear();
}

void Wire::shut() {
  if (socket_ >= 0) ::shutdown(socket_, SHUT_WR);
}

int connect_to(const std::string& path) {
  const int socket = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (socket < 0 || path.size() >= sizeof(address.sun_path)) return socket;
  std::memcpy(address.sun_path, path.c_str(), path.size() + 1);
  if (::connect(socket, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0) return socket;
  ::close(socket);
  return -1;
}

}  // namespace drivebench::simulator
