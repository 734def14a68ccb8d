#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "protocols/can/frame.hpp"
#include "server/config/config.hpp"

/// What the bench tells the device under test beside its samples: outputs of a run, decided by its samples
/// alone. They change no state of the bench, so a recording does not need them.
namespace drivebench {

/// A line for the standard input of the device, without its end.
struct LineMessage {
  std::string text;
};

/// A frame on a CAN bus of the bench.
struct FrameMessage {
  std::size_t bus = 0;  ///< of BenchConfig::can
  can::Frame frame{};
};

/// Holding registers to write in a device that is a Modbus server of its own: function 6 for one value, 16
/// for more.
struct RegisterMessage {
  std::string address;  ///< numeric
  std::uint16_t port = 502;
  int unit = 1;
  int first = 0;
  std::vector<std::uint16_t> values{};
};

struct DeviceMessage {
  Tick tick = 0;  ///< whose sample it precedes, or the ticks between its trigger and that
  std::optional<Trigger> trigger{};
  std::variant<LineMessage, FrameMessage, RegisterMessage> content{};
};

/// `line "speed 100"`, `frame 201#0f00` or `registers 100 = 1500 of unit 1 at 127.0.0.1:1502`.
std::string text_of(const DeviceMessage& message);

/// Reads the [[message]] tables of a text; `name` is that of its file. Throws ConfigError with every problem.
std::vector<DeviceMessage> parse_messages(std::string_view text, const std::string& name,
                                          const BenchConfig& config);
/// parse_messages() of a file.
std::vector<DeviceMessage> read_messages(const std::filesystem::path& file, const BenchConfig& config);

}  // namespace drivebench
