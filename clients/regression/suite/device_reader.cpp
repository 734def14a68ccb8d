#include "clients/regression/suite/device_reader.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "protocols/text.hpp"

namespace drivebench::regression {
namespace {

/// `{a = {b = 1.0}}` as `a.b = 1.0`, as gains are named.
void flatten(const ConfigNode& table, const std::string& prefix, KeyTable& gains, DeviceUnderTest& device) {
  for (const ConfigNode& child : table.children) {
    const std::string name = prefix + child.key;
    const std::optional<double> value = number_in(child);
    if (child.kind == ConfigNode::Kind::kTable) {
      flatten(child, name + ".", gains, device);
    } else if (value) {
      device.gains.emplace_back(name, *value);
    } else {
      gains.report(name, "is " + described(child) + " but must be a finite number");
    }
  }
}

using LinkWord = std::pair<std::string_view, DeviceUnderTest::Link>;

void read_link(KeyTable& table, DeviceUnderTest& device) {
  using Link = DeviceUnderTest::Link;
  static constexpr auto kWords = std::to_array<LinkWord>({{"unix", Link::kUnix},
                                                          {"tcp", Link::kTcp},
                                                          {"shm", Link::kSharedMemory},
                                                          {"can", Link::kCan},
                                                          {"modbus", Link::kModbus}});
  const auto word = table.text("link");
  if (!word) return;
  if (device.kind != DeviceUnderTest::Kind::kProgram) table.report("link", "belongs to a command");
  const auto found = std::ranges::find(kWords, *word, &LinkWord::first);
  if (found != kWords.end()) {
    device.link = found->second;
  } else {
    table.report("link",
                 fmt::format("is \"{}\" but must be \"unix\", \"tcp\", \"shm\", \"can\" or \"modbus\"",
                             printable(*word)));
  }
}

/// Whether a place leaves its port to the system. Other rules are those of the bench.
bool has_no_fixed_port(const ConfigNode& place) {
  const ConfigNode* const port = find_child(place, "port");
  const ConfigNode* const channel = find_child(place, "channel");
  const auto* const number = port != nullptr ? std::get_if<std::int64_t>(&port->scalar) : nullptr;
  const auto* const text = channel != nullptr ? std::get_if<std::string>(&channel->scalar) : nullptr;
  return (number != nullptr && *number == 0) || (text != nullptr && text->ends_with(":0"));
}

/// Where an attached drive waits for the bench.
void read_place(KeyTable& table, DeviceUnderTest& device) {
  using Link = DeviceUnderTest::Link;
  static constexpr auto kWords =
      std::to_array<LinkWord>({{"can", Link::kCan}, {"modbus", Link::kModbus}, {"tcp", Link::kTcp}});
  const auto word = table.text("attached");
  const auto found = std::ranges::find(kWords, word.value_or(""), &LinkWord::first);
  for (const auto& [key, link] : kWords) {
    if (table.has(key) && (!word || *word != key))
      table.report(key, fmt::format("belongs to attached = \"{}\"", key));
    table.node(key);
  }
  if (!word) return;
  if (found == kWords.end()) {
    table.report("attached",
                 fmt::format("is \"{}\" but must be \"can\", \"modbus\" or \"tcp\"", printable(*word)));
    return;
  }
  device.link = found->second;
  table.require(found->first);
  if (!table.table(found->first)) return;
  device.place = *table.node(found->first);
  if (has_no_fixed_port(device.place)) {
    table.report(found->first, "leaves its port to the system: a drive that waits for it cannot know it");
  }
}

}  // namespace

DeviceUnderTest read_device(KeyTable& table) {
  DeviceUnderTest device;
  device.line = table.line();
  const auto preset = table.text("preset");
  const ConfigNode* const gains = table.node("gains");
  device.command = table.texts("command");
  device.axis = table.text("axis").value_or("0");
  device.time_limit_s = table.number("time_limit_s", 0.1, 86'400.0).value_or(device.time_limit_s);
  if (preset) {
    device.kind = DeviceUnderTest::Kind::kPreset;
    device.preset = *preset;
  } else if (table.has("command")) {
    device.kind = DeviceUnderTest::Kind::kProgram;
  } else if (table.has("attached")) {
    device.kind = DeviceUnderTest::Kind::kAttached;
  } else {
    table.require("preset");
  }
  if (preset && table.has("command")) table.report("command", "cannot stand beside preset");
  if (table.has("attached") && device.kind != DeviceUnderTest::Kind::kAttached)
    table.report("attached", "cannot stand beside preset or command: nothing is started");
  read_link(table, device);
  read_place(table, device);
  if (gains != nullptr && !preset) table.report("gains", "belongs to a preset");
  if (gains != nullptr) {
    if (auto inner = table.table("gains")) flatten(*gains, "", *inner, device);
  }
  table.finish();
  return device;
}

}  // namespace drivebench::regression
