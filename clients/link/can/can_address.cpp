#include "clients/link/can/can_address.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "clients/link/can/can_bus_kind.hpp"
#include "clients/link/common/address.hpp"
#include "protocols/can/codec.hpp"
#include "protocols/can/formats/slcan.hpp"
#include "protocols/can/formats/text.hpp"

namespace drivebench::link {
namespace {

constexpr std::string_view kCanScheme = "can:";

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

/// Decimal digits, or hexadecimal ones after 0x.
std::optional<std::uint32_t> whole(std::string_view text) {
  const bool is_hex = text.starts_with("0x");
  return can::parse_number(text.substr(is_hex ? 2 : 0), is_hex ? 16 : 10);
}

std::optional<double> real(std::string_view text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

can::Backend backend_named(std::string_view text, std::string_view name) {
  std::string known;
  for (const can::BackendRow& row : can::kBackends) {
    if (row.name == name) return row.backend;
    known += (known.empty() ? "" : ", ") + std::string(row.name);
  }
  bad(text, "after can: comes one of " + known);
}

/// Splits the text at the first `at`; without one the second part is empty.
std::pair<std::string_view, std::string_view> split(std::string_view text, char at) {
  const std::size_t place = text.find(at);
  if (place == std::string_view::npos) return {text, {}};
  return {text.substr(0, place), text.substr(place + 1)};
}

bool read_switch(std::string_view text, std::string_view key, std::string_view value) {
  if (value == "1") return true;
  if (value != "0") bad(text, std::string(key) + " must be 0 or 1");
  return false;
}

/// Sets the identifier of a message; false if the key is not the name of a message.
bool read_id(std::string_view text, std::string_view key, std::string_view value, can::Profile& profile) {
  for (const can::MessageRow& row : can::kMessages) {
    if (row.name != key) continue;
    const auto id = whole(value);
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

can::IdSet id_set_named(std::string_view text, std::string_view name) {
  const auto found = std::ranges::find(can::kIdSetNames, name);
  if (found == can::kIdSetNames.end()) bad(text, "identifiers must be free or canopen");
  return static_cast<can::IdSet>(found - can::kIdSetNames.begin());
}

/// Reads the keys that choose the default identifiers; other keys change some of these. False: another key.
bool read_choice(std::string_view text, std::string_view key, std::string_view value, can::Profile& profile) {
  if (key == "extended") {
    profile.choose_ids(profile.id_set, read_switch(text, key, value));
  } else if (key == "identifiers") {
    profile.choose_ids(id_set_named(text, value), profile.extended);
  } else {
    return false;
  }
  return true;
}

void read_key(std::string_view text, std::string_view key, std::string_view value, CanAddress& address) {
  if (key == "node") {
    address.node = whole(value).value_or(0);
  } else if (key == "fd") {
    address.profile.fd = read_switch(text, key, value);
  } else if (key == "bus") {
    address.bus = value;
  } else if (key == "bit_rate") {
    address.bit_rate = whole(value).value_or(0);
    if (!can::slcan_bit_rate(address.bit_rate)) bad(text, "adapters have no such bit rate");
  } else if (key == "data_bit_rate") {
    address.data_bit_rate = whole(value).value_or(0);
    if (!can::slcan_data_bit_rate(address.data_bit_rate)) bad(text, "adapters have no such data bit rate");
  } else if (!read_id(text, key, value, address.profile) && !read_unit(text, key, value, address.profile)) {
    bad(text, "there is no key '" + std::string(key) +
                  "'; there are node, fd, extended, identifiers, bus, bit_rate, data_bit_rate, the names of "
                  "messages and of units");
  }
}

}  // namespace

bool is_can_address(std::string_view text) noexcept {
  return text.starts_with(kCanScheme);
}

CanAddress parse_can_address(std::string_view text) {
  const auto [place, keys] = split(is_can_address(text) ? text.substr(kCanScheme.size()) : text, '?');
  const auto [name, channel] = split(place, ':');
  CanAddress address;
  address.backend = backend_named(text, name);
  const std::string rule = bus_kind(address.backend).read_channel(channel, address);
  if (!rule.empty()) bad(text, rule);
  std::vector<std::pair<std::string_view, std::string_view>> changes;
  for (std::string_view rest = keys; !rest.empty();) {
    const auto [pair, after] = split(rest, '&');
    const auto [key, value] = split(pair, '=');
    if (!read_choice(text, key, value, address.profile)) changes.emplace_back(key, value);
    rest = after;
  }
  for (const auto& [key, value] : changes)
    read_key(text, key, value, address);
  const std::array<std::uint32_t, 1> nodes = {address.node};
  for (const can::ProfileProblem& problem : can::problems(address.profile, nodes)) {
    bad(text, problem.field + " " + problem.rule);
  }
  return address;
}

unsigned can_mode_of(v1::Gates gates) noexcept {
  if (gates == v1::GATES_CURRENT) return can::kCurrentMode;
  return gates == v1::GATES_DUTY ? can::kLegDutyMode : static_cast<unsigned>(gates);
}

std::string to_string(const CanAddress& address) {
  std::string text =
      std::string(kCanScheme) + std::string(can::name_of(address.backend)) + ":" + address.channel;
  if (address.port != 0) text += ":" + std::to_string(address.port);
  return text;
}

}  // namespace drivebench::link
