#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

/// The back ends of a CAN bus, for the configuration of the server and for the links of clients.
namespace drivebench::can {

/// The transport that carries the frames of a bus.
enum class Backend : std::uint8_t { kSocketCan, kUdpMulticast, kSlcan, kSocketcand };

struct BackendRow {
  Backend backend;
  std::string_view name;             ///< in configurations and in links
  std::string_view default_channel;  ///< empty: the channel must be named
  std::uint16_t default_port;        ///< 0: the back end has no port
  double frames_per_s;  ///< the most that a bench sends, whatever the bit rate allows; 0: no limit
};

/// Beyond 8000 datagrams/s the buffers of receivers lose some.
inline constexpr auto kBackends = std::to_array<BackendRow>({
    {Backend::kSocketCan, "socketcan", "", 0, 0.0},
    {Backend::kUdpMulticast, "udp_multicast", "239.74.163.2", 43113, 8000.0},
    {Backend::kSlcan, "slcan", "", 0, 0.0},
    {Backend::kSocketcand, "socketcand", "127.0.0.1", 29536, 0.0},
});
static_assert([] {
  for (std::size_t i = 0; i < kBackends.size(); ++i) {
    if (kBackends[i].backend != static_cast<Backend>(i)) return false;
  }
  return true;
}());

constexpr const BackendRow& row_of(Backend backend) noexcept {
  return kBackends[static_cast<std::size_t>(backend)];
}
constexpr std::string_view name_of(Backend backend) noexcept {
  return row_of(backend).name;
}

}  // namespace drivebench::can
