#include "server/config/sections/can.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "protocols/can/backends.hpp"
#include "protocols/can/codec.hpp"
#include "protocols/can/frame.hpp"
#include "protocols/text.hpp"
#include "server/config/words.hpp"

namespace drivebench {
namespace {

constexpr std::size_t kMaxChannel = 255;
constexpr std::size_t kMaxInterfaceName = 15;  // IFNAMSIZ
constexpr std::uint32_t kMaxBaud = 4'000'000;
constexpr std::int64_t kMinBitRate = 10'000;
constexpr std::int64_t kMaxBitRate = 1'000'000;
constexpr std::int64_t kMaxDataBitRate = 8'000'000;
constexpr std::int64_t kMaxEveryTicks = 1'000'000;
constexpr std::int64_t kMinTimeMs = 10;
constexpr std::int64_t kMaxTimeMs = 60'000;
constexpr std::int64_t kMinIdleMs = 100;
constexpr std::int64_t kMaxIdleMs = 86'400'000;
constexpr double kMinUnit = 1e-12;
constexpr double kMaxUnit = 1e6;

bool is_number(std::string_view text, std::uint32_t minimum, std::uint32_t maximum) {
  std::uint32_t number = 0;
  const char* const end = text.data() + text.size();
  const auto result = std::from_chars(text.data(), end, number);
  return result.ec == std::errc() && result.ptr == end && number >= minimum && number <= maximum;
}

/// Whether the text can be the name of an interface.
bool is_interface(std::string_view name) {
  return name.size() <= kMaxInterfaceName && name.find_first_of("/: ") == std::string_view::npos &&
         name != "." && name != "..";
}

bool is_file(std::string_view path) {
  return path.starts_with('/') && !path.ends_with('/');
}

std::string_view without_baud(std::string_view device) {
  return device.substr(0, device.rfind('@'));
}

/// Whether the text is "ADDRESS:PORT" or "[ADDRESS]:PORT" with a loopback address.
bool is_local_listener(std::string_view place) {
  const std::size_t colon = place.rfind(':');
  if (colon == std::string_view::npos || !is_number(place.substr(colon + 1), 0, 65535)) return false;
  std::string_view address = place.substr(0, colon);
  if (address.starts_with('[') && address.ends_with(']')) address = address.substr(1, address.size() - 2);
  return is_loopback(std::string(address));
}

bool is_slcan(std::string_view channel) {
  if (channel.starts_with("pty:")) return is_file(channel.substr(4));
  if (channel.starts_with("tcp:")) return is_local_listener(channel.substr(4));
  const std::string_view device = without_baud(channel);
  const bool baud_ok =
      device.size() == channel.size() || is_number(channel.substr(device.size() + 1), 300, kMaxBaud);
  return is_file(device) && baud_ok;
}

// The resource that only one bus can use; empty: the bus needs none.
std::string channel_of(const CanConfig& bus) {
  return bus.channel;
}
std::string port_of(const CanConfig& bus) {  // a port receives the frames of every group
  return ':' + std::to_string(bus.port);
}
std::string slcan_place(const CanConfig& bus) {
  if (bus.channel.starts_with("tcp:")) return bus.channel.ends_with(":0") ? "" : bus.channel;
  return std::string(without_baud(bus.channel));
}
std::string listener_of(const CanConfig& bus) {
  return bus.port == 0 ? "" : bus.channel + ':' + std::to_string(bus.port);
}

/// The rules for channel and port of each back end.
struct ChannelRules {
  can::Backend backend;
  bool (*is_channel)(const std::string& channel);
  std::string_view channel_rule;  ///< the form of a channel, for refusals
  std::int64_t least_port;
  std::string (*place)(const CanConfig& bus);
  std::string_view same_port;  ///< the rule for ports; empty: the rule for channels is enough
};
constexpr auto kChannelRules = std::to_array<ChannelRules>({
    {can::Backend::kSocketCan, [](const std::string& channel) { return is_interface(channel); },
     "the name of an interface: 1 to 15 bytes without '/', ':' and blanks", 0, channel_of, ""},
    {can::Backend::kUdpMulticast, is_multicast,
     "a multicast address: 224.0.0.0 to 239.255.255.255, or ff00::/8", 1, port_of,
     "all groups at a port are one bus"},
    {can::Backend::kSlcan, [](const std::string& channel) { return is_slcan(channel); },
     "\"pty:PATH\", \"tcp:ADDRESS:PORT\" with a loopback address, or the PATH of a serial device, if need be "
     "with \"@BAUD\" (300 to 4000000); paths are absolute",
     0, slcan_place, ""},
    {can::Backend::kSocketcand, is_loopback, "a loopback address: socketcand knows no password", 0,
     listener_of, ""},
});

const ChannelRules& rules_of(can::Backend backend) {
  return *std::ranges::find(kChannelRules, backend, &ChannelRules::backend);
}
static_assert(kChannelRules.size() == can::kBackends.size());

void read_channel(StrictTable& table, CanConfig& bus) {
  const std::string_view usual = can::row_of(bus.backend).default_channel;
  if (usual.empty()) {
    table.require("channel");
  } else {
    bus.channel = usual;
  }
  if (const auto channel = table.text("channel", kMaxChannel)) {
    bus.channel = *channel;
    const ChannelRules& rules = rules_of(bus.backend);
    if (!rules.is_channel(*channel)) {
      table.report("channel",
                   "is \"" + printable(*channel) + "\" but must be " + std::string(rules.channel_rule));
    }
  }
}

void read_port(StrictTable& table, CanConfig& bus) {
  const std::uint16_t usual = can::row_of(bus.backend).default_port;
  if (usual != 0) bus.port = usual;
  const auto port = table.integer("port", rules_of(bus.backend).least_port, 65535);
  bus.port = static_cast<std::uint16_t>(port.value_or(bus.port));
  if (port && usual == 0) {
    table.report("port", "is " + std::to_string(*port) + " but must be left out with backend \"" +
                             std::string(can::name_of(bus.backend)) + '"');
  }
}

void read_rates(StrictTable& table, CanConfig& bus) {
  const auto data_rate = table.integer("data_bit_rate", kMinBitRate, kMaxDataBitRate);
  bus.bit_rate = table.integer("bit_rate", kMinBitRate, kMaxBitRate).value_or(bus.bit_rate);
  bus.data_bit_rate = data_rate.value_or(bus.data_bit_rate);
  if (bus.data_bit_rate < bus.bit_rate) {
    table.report("data_bit_rate",
                 "is " + std::to_string(bus.data_bit_rate) +
                     " but must not be lower than bit_rate = " + std::to_string(bus.bit_rate));
  }
  bus.sample_every_ticks =
      table.integer("sample_every_ticks", 1, kMaxEveryTicks).value_or(bus.sample_every_ticks);
  bus.state_every_ticks =
      table.integer("state_every_ticks", 1, kMaxEveryTicks).value_or(bus.state_every_ticks);
}

/// Reads a time of at least `minimum`, or 0 for none.
void read_time_or_none(StrictTable& table, std::string_view key, std::int64_t minimum, std::int64_t maximum,
                       std::int64_t& time_ms) {
  time_ms = table.integer(key, 0, maximum).value_or(time_ms);
  if (time_ms == 0 || time_ms >= minimum) return;
  table.report(key,
               "is " + std::to_string(time_ms) + " but must be 0 or at least " + std::to_string(minimum));
}

void read_times(StrictTable& table, CanConfig& bus) {
  read_time_or_none(table, "heartbeat_ms", kMinTimeMs, kMaxTimeMs, bus.heartbeat_ms);
  read_time_or_none(table, "idle_timeout_ms", kMinIdleMs, kMaxIdleMs, bus.idle_timeout_ms);
  bus.controller_timeout_ms =
      table.integer("controller_timeout_ms", kMinTimeMs, kMaxTimeMs).value_or(bus.controller_timeout_ms);
}

void read_ids(StrictTable ids, can::Profile& profile) {
  const std::uint32_t largest = profile.extended ? can::kMaxExtendedId : can::kMaxStandardId;
  for (std::size_t i = 0; i < kCanMessages.size(); ++i) {
    const can::MessageRow& row = *kCanMessages[i];
    const auto id = ids.hexadecimal_integer(row.name, 0, largest - (row.per_node ? profile.max_node() : 0));
    profile.base_ids[i] = static_cast<std::uint32_t>(id.value_or(profile.base_ids[i]));
  }
  for (const can::ProfileProblem& problem : can::problems(profile)) {
    const std::string_view name = std::string_view(problem.field).substr(problem.field.find('.') + 1);
    const auto row = std::find_if(kCanMessages.begin(), kCanMessages.end(),
                                  [&](const can::MessageRow* other) { return other->name == name; });
    if (row == kCanMessages.end()) continue;
    const std::uint32_t id = profile.base_ids[static_cast<std::size_t>(row - kCanMessages.begin())];
    ids.report(name, "is " + hexadecimal(id) + " but " + problem.rule);
  }
  ids.finish();
}

void read_units(StrictTable units, can::Profile& profile) {
  for (const auto& [key, unit] : kCanUnits)
    profile.*unit = units.real(key, kMinUnit, kMaxUnit).value_or(profile.*unit);
  units.finish();
}

void read_profile(StrictTable& table, std::span<const std::uint32_t> nodes, CanConfig& bus) {
  bus.profile.fd = table.boolean("fd").value_or(bus.profile.fd);
  const bool extended = table.boolean("extended").value_or(bus.profile.extended);
  const std::size_t set = table.choice("identifiers", can::kIdSetNames).value_or(0);
  bus.profile.choose_ids(static_cast<can::IdSet>(set), extended);
  for (const std::uint32_t node : nodes) {
    if (node <= bus.profile.max_node()) continue;
    table.report("identifiers", "is \"free\", which has room for nodes 1 to " +
                                    std::to_string(bus.profile.max_node()) + ", but an axis has node " +
                                    std::to_string(node) +
                                    ": extended = true and identifiers = \"canopen\" have room for 127");
  }
  bus.edges = table.boolean("edges").value_or(bus.edges);
  if (bus.edges && !bus.profile.fd) {
    table.report("edges", "is true but must be false without fd = true: the edges of a tick need 64 bytes");
  }
  read_ids(table.table("ids"), bus.profile);
  read_units(table.table("units"), bus.profile);
}

void check_place(StrictTable& table, const CanConfig& bus, const std::vector<CanConfig>& others) {
  const ChannelRules& rules = rules_of(bus.backend);
  const std::string place = rules.place(bus);
  const auto same = [&](const CanConfig& other) {
    return other.backend == bus.backend && rules.place(other) == place;
  };
  if (place.empty() || std::none_of(others.begin(), others.end(), same)) return;
  const std::string another = "of another " + std::string(can::name_of(bus.backend)) + " bus";
  if (rules.same_port.empty()) {
    table.report("channel", "is \"" + printable(bus.channel) + "\", the channel " + another);
  } else {
    table.report("port", "is " + std::to_string(bus.port) + ", the port " + another + ": " +
                             std::string(rules.same_port));
  }
}

constexpr auto kBackendWords = [] {
  std::array<std::string_view, can::kBackends.size()> words{};
  for (std::size_t i = 0; i < words.size(); ++i)
    words[i] = can::kBackends[i].name;
  return words;
}();

}  // namespace

std::vector<CanConfig> read_can(StrictTable& root, std::span<const std::uint32_t> nodes, bool wide) {
  std::vector<CanConfig> buses;
  for (StrictTable& table : root.tables("can", kMaxCanBuses)) {
    CanConfig bus;
    bus.profile.wide = wide;
    table.require("backend");
    const auto backend = table.choice("backend", kBackendWords);
    if (backend) {
      bus.backend = can::kBackends[*backend].backend;
      read_channel(table, bus);
      read_port(table, bus);
      check_place(table, bus, buses);
    } else {  // the keys still count as known
      table.text("channel", kMaxChannel);
      table.integer("port", 0, 65535);
    }
    bus.required = table.boolean("required").value_or(bus.required);
    read_profile(table, nodes, bus);
    read_rates(table, bus);
    read_times(table, bus);
    table.finish();
    buses.push_back(std::move(bus));
  }
  return buses;
}

}  // namespace drivebench
