#include <algorithm>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/text.hpp"
#include "server/bench/digest.hpp"
#include "server/config/config.hpp"
#include "server/config/sections/can.hpp"
#include "server/config/sections/curves.hpp"
#include "server/config/sections/events.hpp"
#include "server/config/sections/parameters.hpp"
#include "server/config/words.hpp"

namespace drivebench {
namespace {

std::string boolean(bool value) {
  return value ? "true" : "false";
}

void append(std::string& text, std::string_view key, const std::string& value) {
  text.append(key).append(" = ").append(value).append("\n");
}

void append_timing(std::string& text, const BenchSetup& setup) {
  append(text, "period_us", real_text(static_cast<double>(setup.period_ns) / 1e3));
  append(text, "substeps", std::to_string(setup.substeps));
  append(text, "seed", std::to_string(setup.seed));
  append(text, "command_delay_ticks", std::to_string(setup.command_delay_ticks));
  append(text, "arming_commands", std::to_string(setup.arming_commands));
  append(text, "watchdog_ticks", std::to_string(setup.watchdog_ticks));
  append(text, "lease_ticks", std::to_string(setup.lease_ticks));
}

/// Whether a text names every key, or those that the hash of the configuration knows: see Parameter::later.
enum class Keys { kAll, kHashed };

void append_parameters(std::string& text, const AxisSetup& setup, Keys keys) {
  const AxisParameters& p = setup.parameters;
  std::vector<std::string_view> sections;
  for (const Parameter& row : axis_parameters(p)) {
    if (std::find(sections.begin(), sections.end(), section_of(row.name)) == sections.end())
      sections.push_back(section_of(row.name));
  }
  for (const std::string_view section : sections) {
    if (setup.shares_shaft_with && section == "mechanics") continue;
    if (setup.shares_amplifier_with && is_section_of_drive(section)) continue;
    text.append("\n[axis.").append(section).append("]\n");
    if (section == "machine") append(text, "kind", in_quotes(machine_kind(p)));
    for (const Parameter& row : axis_parameters(p)) {
      if (section_of(row.name) != section || (keys == Keys::kHashed && row.later && row.get(p) == 0.0))
        continue;
      append(text, key_of(row.name), value_text(row, row.get(p)));
    }
    for (const CurveParameter& row : axis_curves(p)) {
      if (section_of(row.name) != section || row.get(p).empty()) continue;
      append(text, key_of(row.name), curve_text(row.get(p)));
    }
  }
}

void append_axis(std::string& text, const BenchConfig& bench, const EventPlace& place, Keys keys) {
  const AxisSetup& setup = bench.setup.axes[place.axis];
  if (!setup.shares_amplifier_with) {
    append(text, "on_link_loss", in_quotes(name_of(setup.on_link_loss)));
    append(text, "quick_stop_ticks", std::to_string(setup.quick_stop_ticks));
    append(text, "on_excess", in_quotes(kOnExcessWords[static_cast<std::size_t>(setup.rules.on_excess)]));
    append(text, "slew_per_s", real_text(setup.rules.slew_per_s));
  }
  append_parameters(text, setup, keys);
  text += events_text(bench.axes[place.axis].events, setup.parameters, place);
}

void append_service(std::string& text, const RealtimeConfig& realtime, const TcpConfig& tcp) {
  text += "\n[realtime]\n";
  append(text, "pacer", in_quotes(name_of(realtime.pacer)));
  append(text, "max_lateness_ms", real_text(static_cast<double>(realtime.max_lateness_ns) / 1e6));
  append(text, "cpu", std::to_string(realtime.cpu));
  append(text, "priority", std::to_string(realtime.priority));
  text += "\n[tcp]\n";
  // The text has no tokens, and without them a non-loopback address would be refused.
  if (is_loopback(tcp.address)) append(text, "address", in_quotes(tcp.address));
  append(text, "port", std::to_string(tcp.port));
  if (!tcp.unix_path.empty()) append(text, "unix_path", in_quotes(tcp.unix_path));
  append(text, "max_sessions", std::to_string(tcp.max_sessions));
  if (tcp.max_sessions_of_address) {
    append(text, "max_sessions_of_address", std::to_string(*tcp.max_sessions_of_address));
  }
}

void append_can(std::string& text, const CanConfig& bus) {
  text += "\n[[can]]\n";
  append(text, "backend", in_quotes(can::name_of(bus.backend)));
  append(text, "channel", in_quotes(bus.channel));
  if (can::row_of(bus.backend).default_port != 0) append(text, "port", std::to_string(bus.port));
  append(text, "required", boolean(bus.required));
  append(text, "fd", boolean(bus.profile.fd));
  append(text, "extended", boolean(bus.profile.extended));
  append(text, "identifiers", in_quotes(can::kIdSetNames[static_cast<std::size_t>(bus.profile.id_set)]));
  append(text, "bit_rate", std::to_string(bus.bit_rate));
  append(text, "data_bit_rate", std::to_string(bus.data_bit_rate));
  append(text, "sample_every_ticks", std::to_string(bus.sample_every_ticks));
  append(text, "state_every_ticks", std::to_string(bus.state_every_ticks));
  append(text, "edges", boolean(bus.edges));
  append(text, "heartbeat_ms", std::to_string(bus.heartbeat_ms));
  append(text, "controller_timeout_ms", std::to_string(bus.controller_timeout_ms));
  append(text, "idle_timeout_ms", std::to_string(bus.idle_timeout_ms));
  text += "\n[can.ids]\n";
  for (std::size_t i = 0; i < kCanMessages.size(); ++i)
    append(text, kCanMessages[i]->name, hexadecimal(bus.profile.base_ids[i]));
  text += "\n[can.units]\n";
  for (const auto& [key, unit] : kCanUnits)
    append(text, key, real_text(bus.profile.*unit));
}

void append_modbus(std::string& text, const ModbusConfig& modbus) {
  text += "\n[modbus]\n";
  append(text, "address", in_quotes(modbus.address));
  append(text, "port", std::to_string(modbus.port));
  append(text, "allow_writes", boolean(modbus.allow_writes));
  append(text, "unprotected", boolean(modbus.unprotected));
  append(text, "max_connections", std::to_string(modbus.max_connections));
  append(text, "requests_per_s", std::to_string(modbus.requests_per_s));
  append(text, "frame_timeout_ms", std::to_string(modbus.frame_timeout_ms));
  append(text, "idle_timeout_ms", std::to_string(modbus.idle_timeout_ms));
}

}  // namespace

std::string to_toml(const BenchConfig& config) {
  std::string text = "[bench]\n";
  append(text, "name", in_quotes(config.name));
  append(text, "mode", in_quotes(name_of(config.mode)));
  append_timing(text, config.setup);
  append_service(text, config.realtime, config.tcp);
  for (const CanConfig& bus : config.can)
    append_can(text, bus);
  if (config.modbus.enabled) append_modbus(text, config.modbus);
  const std::vector<std::string> names = axis_names(config);
  for (std::size_t i = 0; i < config.axes.size(); ++i) {
    text += "\n[[axis]]\n";
    append(text, "name", in_quotes(config.axes[i].name));
    if (!config.axes[i].motor.empty()) append(text, "motor_name", in_quotes(config.axes[i].motor));
    append(text, "can_node", std::to_string(config.axes[i].can_node));
    if (const auto partner = config.setup.axes[i].shares_shaft_with) {
      append(text, "shares_shaft_with", in_quotes(config.axes[*partner].name));
    }
    if (const auto other = config.setup.axes[i].shares_amplifier_with) {
      append(text, "shares_amplifier_with", in_quotes(config.axes[*other].name));
    }
    append_axis(text, config, {.axis = i, .names = names, .period_ns = config.setup.period_ns}, Keys::kAll);
  }
  return text;
}

std::string physics_toml(const BenchConfig& config) {
  std::string text = "[bench]\n";
  append_timing(text, config.setup);
  std::vector<std::string> numbers;  // the hash ignores names
  for (std::size_t i = 0; i < config.axes.size(); ++i)
    numbers.push_back(std::to_string(i));
  for (std::size_t i = 0; i < config.axes.size(); ++i) {
    text += "\n[[axis]]\n";
    if (const auto partner = config.setup.axes[i].shares_shaft_with) {
      append(text, "shares_shaft_with", numbers[*partner]);
    }
    if (const auto other = config.setup.axes[i].shares_amplifier_with) {
      append(text, "shares_amplifier_with", numbers[*other]);
    }
    append_axis(text, config, {.axis = i, .names = numbers, .period_ns = config.setup.period_ns},
                Keys::kHashed);
  }
  return text;
}

std::uint64_t configuration_hash(const BenchConfig& config) {
  const std::string text = physics_toml(config);
  Digest digest;
  digest.add(text.size());
  for (std::size_t i = 0; i < text.size(); i += 8) {
    std::uint64_t word = 0;
    for (const char c : std::string_view(text).substr(i, 8))
      word = word << 8 | static_cast<unsigned char>(c);
    digest.add(word);
  }
  return digest.value();
}

}  // namespace drivebench
