#include "clients/link/can_address.hpp"

#include <arpa/inet.h>
#include <net/if.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "clients/link/address.hpp"
#include "protocols/can/codec.hpp"
#include "protocols/can/slcan.hpp"

namespace drivebench::link {
namespace {

constexpr std::string_view kScheme = "can:";

struct UnitKey {
  std::string_view name;
  double can::Profile::*unit;
};
constexpr auto kUnits = std::to_array<UnitKey>({
    {"current_unit_a", &can::Profile::current_unit_a},
    {"voltage_unit_v", &can::Profile::voltage_unit_v},
    {"bus_voltage_unit_v", &can::Profile::bus_voltage_unit_v},
    {"speed_unit_rad_s", &can::Profile::speed_unit_rad_s},
    {"edge_time_unit_s", &can::Profile::edge_time_unit_s},
});

[[noreturn]] void bad(std::string_view text, const std::string& rule) {
  throw AddressError("'" + std::string(text) + "' is not an address: " + rule);
}

template <class T>
std::optional<T> whole(std::string_view text) {
  const bool is_hex = text.starts_with("0x");
  if (is_hex) text.remove_prefix(2);
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, is_hex ? 16 : 10);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::optional<double> real(std::string_view text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

can::Backend backend_of(std::string_view text, std::string_view name) {
  std::string known;
  for (const can::BackendRow& row : can::kBackends) {
    if (row.name == name) return row.backend;
    known += (known.empty() ? "" : ", ") + std::string(row.name);
  }
  bad(text, "after can: comes one of " + known);
}

/// Text before and after the first `at`; nothing after it if it does not occur.
std::pair<std::string_view, std::string_view> split(std::string_view text, char at) {
  const std::size_t place = text.find(at);
  if (place == std::string_view::npos) return {text, {}};
  return {text.substr(0, place), text.substr(place + 1)};
}

// What stands between the name of the back end and the keys.

void read_interface(std::string_view text, std::string_view channel, CanAddress& address) {
  if (channel.empty() || channel.size() >= IFNAMSIZ) {
    bad(text, "after socketcan: comes the name of an interface, at most 15 characters");
  }
  address.channel = channel;
}

void read_group(std::string_view text, std::string_view channel, CanAddress& address) {
  auto [group, port] = split(channel, ':');
  if (group.empty()) group = can::row_of(address.backend).default_channel;
  in_addr ip = {};
  if (::inet_pton(AF_INET, std::string(group).c_str(), &ip) != 1 || (ntohl(ip.s_addr) >> 28) != 0xE) {
    bad(text, "after udp_multicast: comes an IPv4 group, 224.0.0.0 to 239.255.255.255, and a port");
  }
  if (!port.empty()) {
    const auto number = whole<std::uint16_t>(port);
    if (!number || *number == 0) bad(text, "the port must be a number from 1 to 65535");
    address.port = *number;
  }
  address.channel = group;
}

void read_terminal(std::string_view text, std::string_view channel, CanAddress& address) {
  if (channel.starts_with("tcp:")) {
    parse_address(channel);
  } else if (!channel.starts_with('/')) {
    bad(text, "after slcan: comes tcp:HOST:PORT or the path of a terminal");
  }
  address.channel = channel;
}

void read_host(std::string_view text, std::string_view channel, CanAddress& address) {
  if (channel.empty()) bad(text, "after socketcand: comes HOST:PORT");
  address.channel = channel;
  if (channel.find(':') == std::string_view::npos) {
    address.channel += ':' + std::to_string(can::row_of(address.backend).default_port);
  }
  parse_address(address.channel);
}

struct ChannelReader {
  can::Backend backend;
  void (*read)(std::string_view text, std::string_view channel, CanAddress& address);
};
constexpr auto kChannelReaders = std::to_array<ChannelReader>({
    {can::Backend::kSocketCan, read_interface},
    {can::Backend::kUdpMulticast, read_group},
    {can::Backend::kSlcan, read_terminal},
    {can::Backend::kSocketcand, read_host},
});
static_assert(kChannelReaders.size() == can::kBackends.size());

bool read_switch(std::string_view text, std::string_view key, std::string_view value) {
  if (value == "1") return true;
  if (value != "0") bad(text, std::string(key) + " must be 0 or 1");
  return false;
}

/// Whether the key is the name of a message; sets its identifier.
bool read_id(std::string_view text, std::string_view key, std::string_view value, can::Profile& profile) {
  for (const can::MessageRow& row : can::kMessages) {
    if (row.name != key) continue;
    const auto id = whole<std::uint32_t>(value);
    if (!id) bad(text, std::string(key) + " must be an identifier, for example 0x210");
    profile.base_ids[static_cast<std::size_t>(row.message)] = *id;
    return true;
  }
  return false;
}

bool read_unit(std::string_view text, std::string_view key, std::string_view value, can::Profile& profile) {
  for (const UnitKey& unit : kUnits) {
    if (unit.name != key) continue;
    const auto number = real(value);
    if (!number) bad(text, std::string(key) + " must be a number");
    profile.*unit.unit = *number;
    return true;
  }
  return false;
}

void read_key(std::string_view text, std::string_view key, std::string_view value, CanAddress& address) {
  if (key == "node") {
    address.node = whole<std::uint32_t>(value).value_or(0);
  } else if (key == "fd") {
    address.profile.fd = read_switch(text, key, value);
  } else if (key == "extended") {
    address.profile.extended = read_switch(text, key, value);
  } else if (key == "bus") {
    address.bus = value;
  } else if (key == "bit_rate") {
    address.bit_rate = whole<std::uint32_t>(value).value_or(0);
    if (!can::slcan_bit_rate(address.bit_rate)) bad(text, "adapters have no such bit rate");
  } else if (key == "data_bit_rate") {
    address.data_bit_rate = whole<std::uint32_t>(value).value_or(0);
    if (!can::slcan_data_bit_rate(address.data_bit_rate)) bad(text, "adapters have no such data bit rate");
  } else if (!read_id(text, key, value, address.profile) && !read_unit(text, key, value, address.profile)) {
    bad(text, "there is no key '" + std::string(key) +
                  "'; there are node, fd, extended, bus, bit_rate, data_bit_rate, the names of messages and "
                  "of units");
  }
}

}  // namespace

bool is_can_address(std::string_view text) noexcept {
  return text.starts_with(kScheme);
}

CanAddress parse_can_address(std::string_view text) {
  const auto [place, keys] = split(is_can_address(text) ? text.substr(kScheme.size()) : text, '?');
  const auto [name, channel] = split(place, ':');
  CanAddress address;
  address.backend = backend_of(text, name);
  std::ranges::find(kChannelReaders, address.backend, &ChannelReader::backend)->read(text, channel, address);
  for (std::string_view rest = keys; !rest.empty();) {
    const auto [pair, after] = split(rest, '&');
    const auto [key, value] = split(pair, '=');
    read_key(text, key, value, address);
    rest = after;
  }
  const std::array<std::uint32_t, 1> nodes = {address.node};
  for (const can::ProfileProblem& problem : can::problems(address.profile, nodes)) {
    bad(text, problem.field + " " + problem.rule);
  }
  return address;
}

std::string to_string(const CanAddress& address) {
  std::string text =
      std::string(kScheme) + std::string(can::name_of(address.backend)) + ":" + address.channel;
  if (address.backend == can::Backend::kUdpMulticast) text += ":" + std::to_string(address.port);
  return text;
}

}  // namespace drivebench::link
