#include "tests/adversity/simulator/peers/crowd.hpp"

#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <utility>

#include "tests/adversity/simulator/world/wire.hpp"

namespace drivebench::simulator {
namespace {

/// More than there are places for clients without hello.
constexpr std::size_t kMost = 60;

constexpr std::uint64_t kMostAtOnce = 16;

/// Whether the server has closed its end, after it said why.
bool is_over(int socket) {
  std::array<std::byte, 4096> said;
  ssize_t count = 0;
  do {
    count = ::recv(socket, said.data(), said.size(), MSG_DONTWAIT);
  } while (count > 0);
  return count == 0 || errno != EAGAIN;
}

}  // namespace

Crowd::Crowd(Scene& scene)
    : scene_(scene), random_(scene.random.fork()), sockets_(1 + random_.below(kMost), -1) {}

void Crowd::take_turn() {
  if (scene_.ending) return;
  std::uint64_t renewed = 0;
  for (int& socket : sockets_) {
    if (socket >= 0 && is_over(socket)) ::close(std::exchange(socket, -1));
    if (socket >= 0 || renewed == kMostAtOnce) continue;
    socket = connect_to(scene_.unix_path);
    ++renewed;
  }
  scene_.note("crowd", 0, renewed);
  scene_.schedule.after(random_.between(1, 20) * kMillisecond, [this] { take_turn(); });
}

void Crowd::leave() {
  for (int& socket : sockets_) {
    if (socket >= 0) ::close(std::exchange(socket, -1));
  }
}

}  // namespace drivebench::simulator
