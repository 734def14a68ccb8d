#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "protocols/catalogue.hpp"

/// The frames of the native CAN profile, written once: codec, DBC file, documentation and bus budget loop
/// over this table. Little-endian throughout.
namespace drivebench::can {

/// Version of the table; the boot-up frame carries it. An identifier or field never changes its meaning
/// within a version.
inline constexpr std::uint8_t kProfileVersion = 1;

enum class Message : std::uint8_t {
  kSync,
  kFault,
  kCurrents,
  kSensors,
  kCommand,
  kEncoder,
  kRequest,
  kReply,
  kState,
  kCounters,
  kIndex,
  kEdges,
  kControllerHeartbeat,
  kHeartbeat,
};

/// In which of the two variants of the profile a message exists.
enum class Variant : std::uint8_t { kBoth, kClassic, kFd };

enum class Sender : std::uint8_t { kBench, kController };

/// Encoding of a field.
enum class Encoding : std::uint8_t {
  kCounter,  ///< unsigned; the low bits of a number that wraps around
  kSigned,   ///< two's complement; the low bits of a number that wraps around
  kCode,     ///< unsigned enumeration or bits; values that do not fit saturate
  kUScaled,  ///< unsigned times the unit; all ones: no value or NaN; saturates one below that
  kScaled,   ///< two's complement times the unit; the lowest number: no value or NaN; saturates at
             ///< +-(2^(n-1)-1)
  kFloat,    ///< IEEE 754 single; NaN: no value
};

/// Which unit a scaled field counts in; the configuration says how much each is.
enum class Unit : std::uint8_t { kNone, kCurrent, kVoltage, kBusVoltage, kSpeed, kEdgeTime };

struct Field {
  std::string_view name;
  std::string_view unit;
  std::uint16_t start_bit;  ///< of the least significant bit: 8 * byte + bit
  std::uint8_t bits;
  Encoding encoding;
  Unit scale;               ///< of the scaled encodings
  std::string_view signal;  ///< row of the catalogue that it carries; empty: none
  std::string_view meaning;
};

/// The codes of the field `request`; 0 in a reply to a command.
enum class Request : std::uint8_t { kCommand = 0, kAcquire = 1, kRenew = 2, kRelease = 3, kClearFaults = 4 };

/// The codes of the field `result`.
enum class Result : std::uint8_t {
  kDone = 0,
  kNotOwner = 1,
  kOwned = 2,
  kNotFinite = 3,
  kLatched = 4,
  kStale = 5,
  kBusy = 6,
  kMalformed = 7,
};

struct MessageRow {
  Message message;
  std::string_view name;
  Variant variant;
  Sender sender;
  std::uint32_t base_id;  ///< the node id is added, if the message has one
  bool per_node;
  std::uint8_t size;  ///< bytes
  std::span<const Field> fields;
  std::string_view meaning;
};

namespace table_detail {

constexpr Field counter(std::string_view name, std::uint16_t start, std::uint8_t bits,
                        std::string_view signal, std::string_view meaning) {
  return {name, "1", start, bits, Encoding::kCounter, Unit::kNone, signal, meaning};
}
constexpr Field counts(std::string_view name, std::uint16_t start, std::string_view signal,
                       std::string_view meaning) {
  return {name, "counts", start, 32, Encoding::kSigned, Unit::kNone, signal, meaning};
}
constexpr Field code(std::string_view name, std::uint16_t start, std::uint8_t bits, std::string_view signal,
                     std::string_view meaning) {
  return {name, "1", start, bits, Encoding::kCode, Unit::kNone, signal, meaning};
}
/// Of the numbers that the meaning lists: "0 this, 1 that". What follows a colon explains.
constexpr Field choice(std::string_view name, std::uint16_t start, std::string_view signal,
                       std::string_view meaning) {
  return {name, "enum", start, 8, Encoding::kCode, Unit::kNone, signal, meaning};
}
constexpr Field flags(std::string_view name, std::uint16_t start, std::uint8_t bits, std::string_view signal,
                      std::string_view meaning) {
  return {name, "bits", start, bits, Encoding::kCode, Unit::kNone, signal, meaning};
}
constexpr Field scaled(std::string_view name, std::string_view unit, std::uint16_t start, Unit scale,
                       std::string_view signal, std::string_view meaning) {
  return {name, unit, start, 16, Encoding::kScaled, scale, signal, meaning};
}
constexpr Field unsigned_scaled(std::string_view name, std::string_view unit, std::uint16_t start, Unit scale,
                                std::string_view signal, std::string_view meaning) {
  return {name, unit, start, 16, Encoding::kUScaled, scale, signal, meaning};
}
constexpr Field real(std::string_view name, std::string_view unit, std::uint16_t start,
                     std::string_view signal, std::string_view meaning) {
  return {name, unit, start, 32, Encoding::kFloat, Unit::kNone, signal, meaning};
}

inline constexpr std::string_view kTickMeaning = "low bits of the tick that the sample was taken at";
inline constexpr std::string_view kLevelsMeaning =
    "1 A, 2 B, 4 Z, 8 last edge counted down, 16 direction changed, 32 period valid";
inline constexpr std::string_view kAgeMeaning = "ticks since the tick that the command in force answered";

inline constexpr auto kSync = std::to_array<Field>({
    counter("tick", 0, 32, "tick", "low bits of the tick that begins; its samples went before"),
    choice("mode", 32, "", "0 real time, 1 lockstep: this tick ends when every controller has answered"),
});
inline constexpr auto kFault = std::to_array<Field>({
    flags("faults", 0, 32, "faults", "fault word"),
    counter("tick", 32, 32, "tick", kTickMeaning),
});
inline constexpr auto kCurrents = std::to_array<Field>({
    scaled("i_a", "A", 0, Unit::kCurrent, "i_a_a", "measured current of phase a, into the machine"),
    scaled("i_b", "A", 16, Unit::kCurrent, "i_b_a", "measured current of phase b, into the machine"),
    counter("tick", 32, 16, "tick", kTickMeaning),
    flags("encoder_levels", 48, 8, "encoder_levels", kLevelsMeaning),
    code("command_age", 56, 8, "command_age_ticks", kAgeMeaning),
});
inline constexpr auto kSensors = std::to_array<Field>({
    counter("tick", 0, 32, "tick", kTickMeaning),
    real("i_a", "A", 32, "i_a_a", "measured current of phase a, into the machine"),
    real("i_b", "A", 64, "i_b_a", "measured current of phase b, into the machine"),
    counts("encoder_count", 96, "encoder_count", "low bits of floor(theta N/(2 pi)), plus the offset"),
    real("edge_age", "s", 128, "edge_age_s", "time since the last edge; since tick 0 if none"),
    real("edge_period", "s", 160, "edge_period_s", "time between the last two edges; 0 until there were two"),
    counter("command_tick", 192, 32, "command_tick",
            "low bits of the tick that the command in force answered; all ones in state 0: none yet"),
    flags("encoder_levels", 224, 8, "encoder_levels", kLevelsMeaning),
    choice("state", 232, "state", "0 idle, 1 run, 2 hold, 3 timeout, 4 fault"),
    counter("missed", 240, 16, "missed_commands", "commands that were owed and did not come"),
});
inline constexpr auto kCommand = std::to_array<Field>({
    scaled("u_a", "V", 0, Unit::kVoltage, "", "voltage for phase a; in mode 3 the duty in units of 1/32767"),
    scaled("u_b", "V", 16, Unit::kVoltage, "", "voltage for phase b; in mode 3 the duty in units of 1/32767"),
    counter("tick", 32, 16, "", "low bits of the tick of the sample that this answers"),
    choice("mode", 48, "", "0 gates off, 1 voltages, 2 zero voltage, 3 duties of the bus voltage"),
    code("lease", 56, 8, "", "lease number that the bench gave"),
});
inline constexpr auto kCommandFd = std::to_array<Field>({
    counter("tick", 0, 32, "", "low bits of the tick of the sample that this answers"),
    real("u_a", "V", 32, "", "voltage for phase a; in mode 3 the duty, -1 to 1"),
    real("u_b", "V", 64, "", "voltage for phase b; in mode 3 the duty, -1 to 1"),
    choice("mode", 96, "", "0 gates off, 1 voltages, 2 zero voltage, 3 duties of the bus voltage"),
    code("lease", 104, 8, "", "lease number that the bench gave"),
});
inline constexpr auto kEncoder = std::to_array<Field>({
    counts("encoder_count", 0, "encoder_count", "low bits of floor(theta N/(2 pi)), plus the offset"),
    unsigned_scaled("edge_age", "s", 32, Unit::kEdgeTime, "edge_age_s",
                    "time since the last edge; since tick 0 if none; the largest number: that or longer"),
    unsigned_scaled(
        "edge_period", "s", 48, Unit::kEdgeTime, "edge_period_s",
        "time between the last two edges; 0 until there were two; the largest number: that or longer"),
});
inline constexpr auto kRequest = std::to_array<Field>({
    choice("request", 0, "", "1 acquire, 2 renew, 3 release, 4 clear faults"),
    code("lease", 8, 8, "", "lease number that the bench gave; 0 with acquire"),
    code("controller", 16, 32, "", "any number by which the controller knows its replies"),
});
inline constexpr auto kReply = std::to_array<Field>({
    choice("request", 0, "", "0 a command, 1 acquire, 2 renew, 3 release, 4 clear faults: what this answers"),
    choice(
        "result", 8, "",
        "0 done, 1 not the owner, 2 owned by another, 3 not finite, 4 latched, 5 stale, 6 busy, 7 malformed"),
    code("controller", 16, 32, "", "the number in the request; 0 for a command"),
    code("lease", 48, 8, "", "lease number to command with, 0: none; of a command, the one that it carried"),
    counter("tick", 56, 8, "",
            "low bits of the tick at whose start it was done, or that the command answered"),
});
inline constexpr auto kState = std::to_array<Field>({
    scaled("speed", "rad/s", 0, Unit::kSpeed, "speed_rad_s", "speed, positive from a to b"),
    unsigned_scaled("bus_voltage", "V", 16, Unit::kBusVoltage, "bus_voltage_v", "voltage of the DC link"),
    flags("faults", 32, 32, "faults", "fault word"),
});
inline constexpr auto kStateFd = std::to_array<Field>({
    counter("tick", 0, 32, "tick", kTickMeaning),
    real("speed", "rad/s", 32, "speed_rad_s", "speed, positive from a to b"),
    real("bus_voltage", "V", 64, "bus_voltage_v", "voltage of the DC link"),
    flags("faults", 96, 32, "faults", "fault word"),
    counter("refused", 128, 16, "refused_commands", "commands that were turned away"),
    counter("late_ticks", 144, 16, "late_ticks", "ticks of the bench that started after their time"),
});
inline constexpr auto kCounters = std::to_array<Field>({
    counter("command_tick", 0, 16, "command_tick",
            "low bits of the tick that the command in force answered; all ones in state 0: none yet"),
    counter("missed", 16, 16, "missed_commands", "commands that were owed and did not come"),
    counter("refused", 32, 16, "refused_commands", "commands that were turned away"),
    counter("late_ticks", 48, 8, "late_ticks", "ticks of the bench that started after their time"),
    choice("state", 56, "state", "0 idle, 1 run, 2 hold, 3 timeout, 4 fault"),
});
inline constexpr auto kIndex = std::to_array<Field>({
    counts("index_count", 0, "index_count", "low bits of the count latched when Z last rose"),
    counter("index_tick", 32, 32, "index_tick", "low bits of the tick in which Z last rose"),
});
inline constexpr auto kEdges = std::to_array<Field>({
    counter("tick", 0, 32, "", "low bits of the tick in which the edges came"),
    counts("start_count", 32, "", "low bits of the count before the first edge of this frame"),
    code("edges", 64, 8, "", "edges in this frame, at most 26"),
    code("following", 72, 8, "",
         "edges of this tick in the frames that follow; all ones: some were left out"),
    // From byte 12 on: 26 edges of 16 bits: bits 0..14 the time in units of the period/32768, bit 15 counts
    // down.
});
inline constexpr auto kControllerHeartbeat = std::to_array<Field>({
    choice("state", 0, "", "0 boot-up, 4 stopped, 5 operational, 127 pre-operational"),
});
inline constexpr auto kHeartbeat = std::to_array<Field>({
    choice("state", 0, "", "0 boot-up, 4 stopped, 5 operational"),
    code("profile", 8, 8, "", "version of the frame table"),
    choice("control", 16, "state", "0 idle, 1 run, 2 hold, 3 timeout, 4 fault"),
    code("lease", 24, 8, "", "lease number in force on this bus; 0: nobody on this bus commands the axis"),
    counter("period_us", 32, 32, "", "sample period of the bench [us]"),
});

}  // namespace table_detail

inline constexpr std::size_t kMaxFields = 10;
inline constexpr std::size_t kEdgesPerFrame = 26;
inline constexpr std::size_t kFirstEdgeByte = 12;

/// Sorted by base id. Node ids are 1..127, as in the predefined connection set of CANopen, whose identifiers
/// for SYNC, emergency, heartbeat and process data these are.
inline constexpr auto kMessages = [] {
  using namespace table_detail;
  using enum Message;
  using enum Sender;
  return std::to_array<MessageRow>({
      {kSync, "sync", Variant::kBoth, kBench, 0x080, false, 5, table_detail::kSync,
       "a tick begins; sent after the samples of its start"},
      {kFault, "fault", Variant::kBoth, kBench, 0x080, true, 8, table_detail::kFault,
       "the fault word has changed"},
      {kCurrents, "currents", Variant::kClassic, kBench, 0x180, true, 8, table_detail::kCurrents,
       "phase currents of a sample; follows the encoder frame of the same tick"},
      {kSensors, "sensors", Variant::kFd, kBench, 0x180, true, 32, table_detail::kSensors,
       "all sensors of a sample"},
      {kCommand, "command", Variant::kClassic, kController, 0x200, true, 8, table_detail::kCommand,
       "what the amplifier shall do"},
      {kCommand, "command", Variant::kFd, kController, 0x200, true, 16, table_detail::kCommandFd,
       "what the amplifier shall do"},
      {kEncoder, "encoder", Variant::kClassic, kBench, 0x280, true, 8, table_detail::kEncoder,
       "encoder count and edge times; flags and tick stand in the currents frame that follows"},
      {kRequest, "request", Variant::kBoth, kController, 0x300, true, 8, table_detail::kRequest,
       "takes, renews or gives back the lease, or clears faults"},
      {kReply, "reply", Variant::kBoth, kBench, 0x380, true, 8, table_detail::kReply,
       "the answer to a request, or why a command was refused"},
      {kState, "state", Variant::kClassic, kBench, 0x400, true, 8, table_detail::kState,
       "state of the drive"},
      {kState, "state", Variant::kFd, kBench, 0x400, true, 20, table_detail::kStateFd, "state of the drive"},
      {kCounters, "counters", Variant::kClassic, kBench, 0x480, true, 8, table_detail::kCounters,
       "what became of the commands"},
      {kIndex, "index", Variant::kBoth, kBench, 0x500, true, 8, table_detail::kIndex, "the index line rose"},
      {kEdges, "edges", Variant::kFd, kBench, 0x580, true, 64, table_detail::kEdges,
       "the edges of the encoder lines A and B within a tick"},
      {kControllerHeartbeat, "controller_heartbeat", Variant::kBoth, kController, 0x680, true, 1,
       table_detail::kControllerHeartbeat, "the controller lives; once seen, it is monitored"},
      {kHeartbeat, "heartbeat", Variant::kBoth, kBench, 0x700, true, 8, table_detail::kHeartbeat,
       "the bench lives"},
  });
}();

/// The row of a message in a variant of the profile, or null.
constexpr const MessageRow* find_message(Message message, bool fd) noexcept {
  for (const MessageRow& row : kMessages) {
    if (row.message != message) continue;
    if (row.variant == Variant::kBoth || (row.variant == Variant::kFd) == fd) return &row;
  }
  return nullptr;
}

}  // namespace drivebench::can
