#include "tests/benchmark/crowd/abusers.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <thread>

#include "clients/link/common/file_descriptor.hpp"

namespace drivebench::speed {
namespace {

using namespace std::chrono_literals;

constexpr std::uint32_t kFlooder = 0x7F000002;  // 127.0.0.2
constexpr std::uint32_t kDripper = 0x7F000003;
constexpr std::size_t kDrippers = 100;
constexpr auto kDripEvery = 450ms;

/// Connected, or connecting with SOCK_NONBLOCK; not open if that failed.
link::FileDescriptor connect_from(std::uint32_t source, std::uint16_t port, int flags) {
  link::FileDescriptor fd(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | flags, 0));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(source);
  const auto* const generic = reinterpret_cast<const sockaddr*>(&address);
  if (::bind(fd.get(), generic, sizeof address) != 0) return {};
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(port);
  if (::connect(fd.get(), generic, sizeof address) != 0 && flags == 0) return {};
  return fd;
}

}  // namespace

void flood_with_illegal_functions(std::uint16_t port) noexcept {
  constexpr std::size_t kAtOnce = 16;
  std::array<std::array<std::uint8_t, 8>, kAtOnce> requests{};
  requests.fill({0, 1, 0, 0, 0, 2, 1, 0x41});
  std::array<char, 4096> answers{};
  for (;;) {
    const link::FileDescriptor fd = connect_from(kFlooder, port, 0);
    if (!fd.is_open()) std::this_thread::sleep_for(1ms);  // all ports in use
    while (fd.is_open() && ::send(fd.get(), requests.data(), sizeof requests, MSG_NOSIGNAL) > 0 &&
           ::recv(fd.get(), answers.data(), answers.size(), 0) > 0) {
    }
  }
}

void drip(std::uint16_t port) noexcept {
  // A request to read a register, without its last byte.
  constexpr std::array<std::uint8_t, 11> kFrame{0, 1, 0, 0, 0, 6, 1, 3, 0, 0, 0};
  struct Dripper {
    link::FileDescriptor fd;
    std::size_t sent = 0;
  };
  std::array<Dripper, kDrippers> drippers;
  for (;; std::this_thread::sleep_for(kDripEvery)) {
    for (Dripper& each : drippers) {
      if (each.sent == kFrame.size()) each.fd.close();
      if (!each.fd.is_open()) each = {.fd = connect_from(kDripper, port, SOCK_NONBLOCK), .sent = 0};
      if (::send(each.fd.get(), &kFrame[each.sent], 1, MSG_NOSIGNAL | MSG_DONTWAIT) == 1) {
        ++each.sent;
      } else {
        each.fd.close();  // cut off
      }
    }
  }
}

}  // namespace drivebench::speed
