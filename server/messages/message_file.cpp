#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <string_view>
#include <utility>

#include "protocols/text.hpp"
#include "server/config/sections/event_time.hpp"
#include "server/config/strict_table.hpp"
#include "server/messages/device_message.hpp"

namespace drivebench {
namespace {

constexpr std::size_t kMostMessages = 1000;
constexpr std::size_t kLongestLine = 500;  ///< [bytes], so that a pipe takes it in one piece
constexpr std::size_t kLongestPlace = 80;
constexpr std::size_t kLongestData = 3 * 64;  ///< of hexadecimal digits and blanks
constexpr std::size_t kMostValues = 123;      ///< of function 16
constexpr std::int64_t kHighestUnit = 247;

/// The bytes of hexadecimal digits, two for each byte, blanks between bytes allowed.
std::optional<std::vector<std::uint8_t>> bytes_of(std::string_view text) {
  std::vector<std::uint8_t> bytes;
  while (!text.empty()) {
    if (text.front() == ' ') {
      text.remove_prefix(1);
      continue;
    }
    std::uint8_t byte = 0;
    const char* const end = text.data() + std::min<std::size_t>(text.size(), 2);
    const auto [stop, error] = std::from_chars(text.data(), end, byte, 16);
    if (error != std::errc{} || stop != text.data() + 2) return std::nullopt;
    bytes.push_back(byte);
    text.remove_prefix(2);
  }
  return bytes;
}

void read_data(StrictTable& table, can::Frame& frame) {
  const auto text = table.node("data") != nullptr ? table.text("data", kLongestData) : std::nullopt;
  if (!text) return;
  const auto bytes = bytes_of(*text);
  if (!bytes) {
    return table.report("data",
                        "is \"" + printable(*text) + "\" but must be bytes of two hexadecimal digits");
  }
  const bool fits = frame.fd ? can::is_fd_size(bytes->size()) : bytes->size() <= 8;
  if (!fits) {
    return table.report("data", fmt::format("has {} bytes but {}", bytes->size(),
                                            frame.fd ? "an FD frame has 0 to 8, 12, 16, 20, 24, 32, 48 or 64"
                                                     : "a classic frame has at most 8"));
  }
  frame.size = static_cast<std::uint8_t>(bytes->size());
  std::ranges::copy(*bytes, frame.data.begin());
}

FrameMessage read_frame(StrictTable table, const BenchConfig& config) {
  FrameMessage message;
  can::Frame& frame = message.frame;
  if (config.can.empty()) {
    table.report("bus", "is none of the bench: it needs a [[can]] section");
  } else {
    const auto last = static_cast<std::int64_t>(config.can.size()) - 1;
    message.bus = static_cast<std::size_t>(table.integer("bus", 0, last).value_or(0));
    frame.fd = config.can[message.bus].profile.fd;
  }
  frame.extended = table.boolean("extended").value_or(false);
  frame.fd = table.boolean("fd").value_or(frame.fd);
  if (frame.fd && !config.can.empty() && !config.can[message.bus].profile.fd)
    table.report("fd", "is true, but the bus has classic frames only");
  const auto id =
      table.hexadecimal_integer("id", 0, frame.extended ? can::kMaxExtendedId : can::kMaxStandardId);
  frame.id = static_cast<std::uint32_t>(id.value_or(0));
  table.require("id");
  read_data(table, frame);
  table.finish();
  return message;
}

/// "ADDRESS:PORT" or "[ADDRESS]:PORT".
bool read_place(std::string_view place, RegisterMessage& message) {
  const std::size_t colon = place.rfind(':');
  if (colon == std::string_view::npos) return false;
  std::string_view address = place.substr(0, colon);
  if (address.starts_with('[') && address.ends_with(']')) address = address.substr(1, address.size() - 2);
  const char* const end = place.data() + place.size();
  const auto [stop, error] = std::from_chars(place.data() + colon + 1, end, message.port);
  message.address = address;
  return error == std::errc{} && stop == end && message.port != 0 && is_address(message.address);
}

void read_values(StrictTable& table, int first, std::vector<std::uint16_t>& values) {
  const ConfigNode* const list = table.node("values");
  table.require("values");
  if (list == nullptr) return;
  for (const ConfigNode& each : list->children) {
    const auto* const value = std::get_if<std::int64_t>(&each.scalar);
    if (value == nullptr || *value < 0 || *value > 65535)
      return table.report("values", "must be whole numbers from 0 to 65535");
    values.push_back(static_cast<std::uint16_t>(*value));
  }
  if (list->kind != ConfigNode::Kind::kArray || values.empty() || values.size() > kMostValues)
    return table.report("values", fmt::format("must be a list of 1 to {} numbers", kMostValues));
  if (static_cast<std::size_t>(first) + values.size() > 65536)
    table.report("values", "reach beyond register 65535");
}

RegisterMessage read_registers(StrictTable table) {
  RegisterMessage message;
  const auto place = table.text("to", kLongestPlace);
  table.require("to");
  if (place && !read_place(*place, message)) {
    table.report("to", "is \"" + printable(*place) +
                           "\" but must be ADDRESS:PORT of the device, the address in numbers");
  }
  message.unit = static_cast<int>(table.integer("unit", 0, kHighestUnit).value_or(1));
  message.first = static_cast<int>(table.integer("register", 0, 65535).value_or(0));
  table.require("register");
  read_values(table, message.first, message.values);
  table.finish();
  return message;
}

LineMessage read_line(StrictTable& table) {
  const auto text = table.text("line", kLongestLine);
  if (!text) return {};
  const auto is_control = [](char c) { return static_cast<unsigned char>(c) < ' ' && c != '\t'; };
  if (std::ranges::any_of(*text, is_control)) table.report("line", "must be a single line of text");
  return {*text};
}

DeviceMessage read_message(StrictTable& table, const BenchConfig& config,
                           std::span<const std::string> names) {
  const auto name = table.text("axis", kLongestPlace).value_or(names.front());
  const auto found = std::ranges::find(names, name);
  if (found == names.end()) table.report("axis", "is \"" + printable(name) + "\", no axis of the bench");
  const std::size_t axis = found == names.end() ? 0 : static_cast<std::size_t>(found - names.begin());
  const EventTime time =
      read_event_time(table, {.axis = axis, .names = names, .period_ns = config.setup.period_ns});
  DeviceMessage message{.tick = time.tick, .trigger = time.trigger};
  const int kinds = static_cast<int>(table.has("line")) + static_cast<int>(table.has("can")) +
                    static_cast<int>(table.has("modbus"));
  if (kinds != 1) {
    table.report(
        "line", fmt::format("is one of line, can and modbus, of which a message has exactly one; here are {}",
                            kinds));
  }
  if (table.has("can")) message.content = read_frame(table.table("can"), config);
  if (table.has("modbus")) message.content = read_registers(table.table("modbus"));
  if (table.has("line")) message.content = read_line(table);
  table.finish();
  return message;
}

}  // namespace

std::vector<DeviceMessage> read_messages(const std::filesystem::path& file, const BenchConfig& config) {
  const FileText read = read_file(file, kMaxConfigBytes);
  if (!read.why_not.empty()) throw ConfigError({{file.string(), 0, {}, read.why_not}});
  return parse_messages(read.text, file.string(), config);
}

std::vector<DeviceMessage> parse_messages(std::string_view text, const std::string& name,
                                          const BenchConfig& config) {
  std::vector<std::string> names;
  for (const AxisConfig& axis : config.axes)
    names.push_back(axis.name);
  ProblemList problems;
  std::vector<DeviceMessage> messages;
  if (const auto document = parse_document(text, name, problems, kMaxConfigBytes)) {
    StrictTable root(&*document, "", 1, name, problems);
    for (StrictTable& table : root.tables("message", kMostMessages))
      messages.push_back(read_message(table, config, names));
    root.finish();
  }
  problems.throw_if_any();
  return messages;
}

namespace {

std::string text_of(const LineMessage& message) {
  return fmt::format("line \"{}\"", message.text);
}

std::string text_of(const FrameMessage& message) {
  const can::Frame& frame = message.frame;
  std::string text = fmt::format("frame {:0{}X}#", frame.id, frame.extended ? 8 : 3);
  for (std::size_t i = 0; i < frame.size; ++i)
    text += fmt::format("{:02x}", frame.data[i]);
  return message.bus == 0 ? text : fmt::format("{} on bus {}", text, message.bus);
}

std::string text_of(const RegisterMessage& message) {
  return fmt::format("registers {} = {} of unit {} at {}:{}", message.first, fmt::join(message.values, ", "),
                     message.unit, message.address, message.port);
}

}  // namespace

std::string text_of(const DeviceMessage& message) {
  return std::visit([](const auto& content) { return text_of(content); }, message.content);
}

}  // namespace drivebench
