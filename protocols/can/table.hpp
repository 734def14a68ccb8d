#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "protocols/can/field.hpp"
#include "protocols/refusals.hpp"

/// The frames of the native CAN profile, written once: codec, DBC file, documentation and bus budget loop
/// over this table. Little-endian throughout.
namespace drivebench::can {

/// The sets of default identifiers. `kFree` keeps clear of every identifier that CANopen (CiA 301)
/// predefines; `kCanopen` are those of CANopen's predefined connection set.
enum class IdSet : std::uint8_t { kFree, kCanopen };

/// The version of the profile; the heartbeat of an axis carries the number. An identifier or field never
/// changes its meaning within a version.
constexpr std::uint8_t version_of(IdSet ids, bool wide_axis) noexcept {
  return static_cast<std::uint8_t>((ids == IdSet::kCanopen ? 1 : 3) + (wide_axis ? 1 : 0));
}

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
  kPhaseCommand,
  kPhases,
  kDetails,
};

/// The variants of the profile in which a message exists.
enum class Variant : std::uint8_t { kBoth, kClassic, kFd };

/// The axes that have a message. A wide axis has more than phases a and b and an encoder: a phase c, a field
/// winding, Hall lines, a tachometer or a resolver.
enum class Width : std::uint8_t { kAny, kNarrow, kWide };

enum class Sender : std::uint8_t { kBench, kController };

/// The codes of the field `request`; 0 in a reply to a command.
enum class Request : std::uint8_t { kCommand = 0, kAcquire = 1, kRenew = 2, kRelease = 3, kClearFaults = 4 };

struct MessageRow {
  Message message;
  std::string_view name;
  Variant variant;
  Width width;
  Sender sender;
  std::uint32_t free_id;     ///< IdSet::kFree with 11 bits; messages of an axis add the node id
  std::uint32_t canopen_id;  ///< IdSet::kCanopen
  bool per_node;
  std::uint8_t size;  ///< bytes
  std::span<const Field> fields;
  std::string_view meaning;
};

namespace table_detail {

inline constexpr std::string_view kTickMeaning = "low bits of the tick that the sample was taken at";
inline constexpr std::string_view kLevelsMeaning =
    "1 A, 2 B, 4 Z, 8 last edge counted down, 16 direction changed, 32 period valid";
inline constexpr std::string_view kAgeMeaning = "ticks since the tick that the command in force answered";

inline constexpr std::string_view kCurrentC = "measured current of phase c, into the machine";
inline constexpr std::string_view kCurrentField = "measured current of the field winding";
inline constexpr std::string_view kHallMeaning = "1 line 1, 2 line 2, 4 line 3";
inline constexpr std::string_view kTachometer = "voltage of the tachometer";
inline constexpr std::string_view kSine = "sine winding of the resolver, demodulated";
inline constexpr std::string_view kCosine = "cosine winding of the resolver, demodulated";
inline constexpr std::string_view kTemperature = "temperature of the windings";
inline constexpr std::string_view kFieldVoltage = "voltage at the field winding";
inline constexpr std::string_view kNeutral = "neutral of the motor against the middle of the DC link";
inline constexpr std::string_view kInjectedMeaning = "injected faults in force";

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
/// A narrow axis has only the first kNarrowSensorFields.
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
    choice("state", 232, "state", "0 idle, 1 run, 2 hold, 3 timeout, 4 fault, 5 ready"),
    counter("missed", 240, 16, "missed_commands", "commands that were owed and did not come"),
    real("i_c", "A", 256, "i_c_a", kCurrentC),
    real("i_f", "A", 288, "i_f_a", kCurrentField),
    real("bus_voltage", "V", 320, "bus_voltage_v", "voltage of the DC link"),
    real("tachometer", "V", 352, "tachometer_v", kTachometer),
    real("resolver_sin", "V", 384, "resolver_sin_v", kSine),
    real("resolver_cos", "V", 416, "resolver_cos_v", kCosine),
    real("temperature", "K", 448, "temperature_k", kTemperature),
    flags("hall_lines", 480, 8, "hall_lines", kHallMeaning),
});
inline constexpr std::size_t kNarrowSensorFields = 10;
inline constexpr auto kPhases = std::to_array<Field>({
    scaled("i_c", "A", 0, Unit::kCurrent, "i_c_a", kCurrentC),
    scaled("i_f", "A", 16, Unit::kCurrent, "i_f_a", kCurrentField),
    counter("tick", 32, 16, "tick", kTickMeaning),
    flags("hall_lines", 48, 8, "hall_lines", kHallMeaning),
});
inline constexpr std::string_view kModeMeaning =
    "0 gates off, 1 voltages, 2 zero voltage, 3 duties from the middle of the link, 4 currents, 5 duties of "
    "legs";
inline constexpr std::string_view kLegsOffMeaning = "1 a, 2 b, 4 c: legs that are off";
inline constexpr std::string_view kSetpointMeaning = "voltage of this phase or winding";
inline constexpr std::string_view kSetpointTick = "low bits of the tick of the sample that this answers";
inline constexpr std::string_view kLeaseMeaning = "lease number that the bench gave";

inline constexpr auto kCommand = std::to_array<Field>({
    setpoint(scaled("u_a", "V", 0, Unit::kVoltage, "", kSetpointMeaning)),
    setpoint(scaled("u_b", "V", 16, Unit::kVoltage, "", kSetpointMeaning)),
    counter("tick", 32, 16, "", kSetpointTick),
    half_byte(choice("mode", 48, "", kModeMeaning)),
    flags("legs_off", 52, 4, "", kLegsOffMeaning),
    code("lease", 56, 8, "", kLeaseMeaning),
});
inline constexpr auto kPhaseCommand = std::to_array<Field>({
    setpoint(scaled("u_c", "V", 0, Unit::kVoltage, "", kSetpointMeaning)),
    setpoint(scaled("u_f", "V", 16, Unit::kVoltage, "", kSetpointMeaning)),
    counter("tick", 32, 16, "", "as in the command that follows"),
    choice("mode", 48, "", kModeMeaning),
    code("lease", 56, 8, "", kLeaseMeaning),
});
/// A narrow axis has only the first kNarrowCommandFields.
inline constexpr auto kCommandFd = std::to_array<Field>({
    counter("tick", 0, 32, "", kSetpointTick),
    setpoint(real("u_a", "V", 32, "", kSetpointMeaning)),
    setpoint(real("u_b", "V", 64, "", kSetpointMeaning)),
    half_byte(choice("mode", 96, "", kModeMeaning)),
    flags("legs_off", 100, 4, "", kLegsOffMeaning),
    code("lease", 104, 8, "", kLeaseMeaning),
    setpoint(real("u_c", "V", 128, "", kSetpointMeaning)),
    setpoint(real("u_f", "V", 160, "", kSetpointMeaning)),
});
inline constexpr std::size_t kNarrowCommandFields = 6;
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
    code("controller", 16, 32, "", "any number; the reply repeats it"),
});
inline constexpr auto kReply = std::to_array<Field>({
    choice("request", 0, "", "0 a command, 1 acquire, 2 renew, 3 release, 4 clear faults: what this answers"),
    choice("result", 8, "", kCanResultMeaning),
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
    counter("refused", 128, 16, "refused_commands", "refused commands of the controller"),
    counter("late_ticks", 144, 16, "late_ticks", "ticks of the bench that started after their time"),
});
inline constexpr auto kCounters = std::to_array<Field>({
    counter("command_tick", 0, 16, "command_tick",
            "low bits of the tick that the command in force answered; all ones in state 0: none yet"),
    counter("missed", 16, 16, "missed_commands", "commands that were owed and did not come"),
    counter("refused", 32, 16, "refused_commands", "refused commands of the controller"),
    counter("late_ticks", 48, 8, "late_ticks", "ticks of the bench that started after their time"),
    choice("state", 56, "state", "0 idle, 1 run, 2 hold, 3 timeout, 4 fault, 5 ready"),
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
    // From byte 12 on: 26 edges of 16 bits. Bits 0..14: time in units of period/32768; bit 15: the count went
    // down.
});
inline constexpr auto kControllerHeartbeat = std::to_array<Field>({
    choice("state", 0, "", "0 boot-up, 4 stopped, 5 operational, 127 pre-operational"),
});
inline constexpr auto kHeartbeat = std::to_array<Field>({
    choice("state", 0, "", "0 boot-up, 4 stopped, 5 operational"),
    code("profile", 8, 8, "", "version of the frame table"),
    choice("control", 16, "state", "0 idle, 1 run, 2 hold, 3 timeout, 4 fault, 5 ready"),
    code("lease", 24, 8, "",
         "lease number in force on this bus; 0: no controller on this bus holds the lease"),
    counter("period_us", 32, 32, "", "sample period of the bench [us]"),
});

inline constexpr auto kDetails = std::to_array<Field>({
    choice("page", 0, "", "0 phase voltages, 1 field and neutral, 2 speed sensors, 3 injected faults"),
    counter("tick", 8, 8, "tick", kTickMeaning),
    on_page(0, scaled("u_a", "V", 16, Unit::kVoltage, "u_a_v",
                      "voltage at phase a at the end of the tick before")),
    on_page(0, scaled("u_b", "V", 32, Unit::kVoltage, "u_b_v",
                      "voltage at phase b at the end of the tick before")),
    on_page(0, scaled("u_c", "V", 48, Unit::kVoltage, "u_c_v",
                      "voltage at phase c at the end of the tick before")),
    on_page(1, scaled("u_f", "V", 16, Unit::kVoltage, "u_f_v", kFieldVoltage)),
    on_page(1, scaled("u_n", "V", 32, Unit::kVoltage, "u_n_v", kNeutral)),
    on_page(1, unsigned_scaled("temperature", "K", 48, Unit::kTemperature, "temperature_k", kTemperature)),
    on_page(2, scaled("tachometer", "V", 16, Unit::kVoltage, "tachometer_v", kTachometer)),
    on_page(2, scaled("resolver_sin", "V", 32, Unit::kResolver, "resolver_sin_v", kSine)),
    on_page(2, scaled("resolver_cos", "V", 48, Unit::kResolver, "resolver_cos_v", kCosine)),
    on_page(3, flags("injected", 16, 32, "injected", kInjectedMeaning)),
});
inline constexpr auto kDetailsFd = std::to_array<Field>({
    counter("tick", 0, 32, "tick", kTickMeaning),
    real("u_a", "V", 32, "u_a_v", "voltage at phase a at the end of the tick before"),
    real("u_b", "V", 64, "u_b_v", "voltage at phase b at the end of the tick before"),
    real("u_c", "V", 96, "u_c_v", "voltage at phase c at the end of the tick before"),
    real("u_f", "V", 128, "u_f_v", kFieldVoltage),
    real("u_n", "V", 160, "u_n_v", kNeutral),
    real("meter_u_rms", "V", 192, "meter_u_rms_v", "power analyser, last whole window: rms voltage"),
    real("meter_i_rms", "A", 224, "meter_i_rms_a", "power analyser: rms current"),
    real("meter_p", "W", 256, "meter_p_w", "power analyser: active power"),
    real("meter_q", "var", 288, "meter_q_var", "power analyser: reactive power"),
    real("meter_pf", "1", 320, "meter_pf", "power analyser: power factor"),
    flags("injected", 352, 32, "injected", kInjectedMeaning),
});

}  // namespace table_detail

/// The pages of the classic message `details`.
enum class Page : std::uint8_t { kVoltages = 0, kField = 1, kSpeedSensors = 2, kInjected = 3 };
inline constexpr std::size_t kPages = 4;

inline constexpr std::size_t kMaxFields = 18;
inline constexpr std::size_t kEdgesPerFrame = 26;
inline constexpr std::size_t kFirstEdgeByte = 12;

/// Sorted by free_id, so that on a busy bus the commands come before the samples and these before the state.
/// CiA 301 predefines 0x000, 0x080..0x67F and 0x700..0x77F. Of the rest this table leaves out 0x001 (CiA 304:
/// global failsafe command), 0x6E0..0x6FF (restricted by CiA 301), 0x7DF..0x7EF (diagnosis of vehicles; LSS
/// of CiA 305) and above. The encoder frame is below the currents frame, which ends a sample.
inline constexpr auto kMessages = [] {
  using namespace table_detail;
  using enum Message;
  using enum Sender;
  using enum Variant;
  using enum Width;
  constexpr std::span kAllSensors(table_detail::kSensors);
  constexpr std::span kWholeCommand(kCommandFd);
  return std::to_array<MessageRow>({
      {kSync, "sync", kBoth, kAny, kBench, 0x008, 0x080, false, 5, table_detail::kSync,
       "a tick begins; sent after the samples of its start"},
      {kFault, "fault", kBoth, kAny, kBench, 0x010, 0x080, true, 8, table_detail::kFault,
       "the fault word has changed"},
      {kPhaseCommand, "phase_command", kClassic, kWide, kController, 0x020, 0x100, true, 8,
       table_detail::kPhaseCommand,
       "setpoints of phase c and of the field; they are kept and take effect with the command of the same "
       "tick, "
       "mode and lease, which follows"},
      {kCommand, "command", kClassic, kAny, kController, 0x030, 0x200, true, 8, table_detail::kCommand,
       "set-points of the amplifier"},
      {kCommand, "command", kFd, kNarrow, kController, 0x030, 0x200, true, 16,
       kWholeCommand.first(kNarrowCommandFields), "set-points of the amplifier"},
      {kCommand, "command", kFd, kWide, kController, 0x030, 0x200, true, 24, kWholeCommand,
       "set-points of the amplifier"},
      {kEncoder, "encoder", kClassic, kAny, kBench, 0x040, 0x280, true, 8, table_detail::kEncoder,
       "encoder count and edge times; flags and tick stand in the currents frame that follows"},
      {kPhases, "phases", kClassic, kWide, kBench, 0x050, 0x600, true, 8, table_detail::kPhases,
       "the other currents of a sample and the Hall lines; stands between the encoder frame and the currents "
       "frame of the same tick"},
      {kCurrents, "currents", kClassic, kAny, kBench, 0x060, 0x180, true, 8, table_detail::kCurrents,
       "phase currents of a sample; follows the encoder frame of the same tick"},
      {kSensors, "sensors", kFd, kNarrow, kBench, 0x060, 0x180, true, 32,
       kAllSensors.first(kNarrowSensorFields), "all sensors of a sample"},
      {kSensors, "sensors", kFd, kWide, kBench, 0x060, 0x180, true, 64, kAllSensors,
       "all sensors of a sample"},
      {kRequest, "request", kBoth, kAny, kController, 0x070, 0x300, true, 8, table_detail::kRequest,
       "takes, renews or gives back the lease, or clears faults"},
      {kReply, "reply", kBoth, kAny, kBench, 0x680, 0x380, true, 8, table_detail::kReply,
       "the answer to a request, or why a command was refused"},
      {kState, "state", kClassic, kAny, kBench, 0x690, 0x400, true, 8, table_detail::kState,
       "state of the drive"},
      {kState, "state", kFd, kAny, kBench, 0x690, 0x400, true, 20, table_detail::kStateFd,
       "state of the drive"},
      {kCounters, "counters", kClassic, kAny, kBench, 0x6A0, 0x480, true, 8, table_detail::kCounters,
       "what became of the commands"},
      {kIndex, "index", kBoth, kAny, kBench, 0x6B0, 0x500, true, 8, table_detail::kIndex,
       "the index line rose"},
      {kEdges, "edges", kFd, kAny, kBench, 0x6C0, 0x580, true, 64, table_detail::kEdges,
       "the edges of the encoder lines A and B within a tick"},
      {kControllerHeartbeat, "controller_heartbeat", kBoth, kAny, kController, 0x780, 0x680, true, 1,
       table_detail::kControllerHeartbeat, "the controller lives; once seen, it is monitored"},
      {kHeartbeat, "heartbeat", kBoth, kAny, kBench, 0x790, 0x700, true, 8, table_detail::kHeartbeat,
       "the bench lives"},
      {kDetails, "details", kClassic, kWide, kBench, 0x7A0, 0x780, true, 8, table_detail::kDetails,
       "voltages, temperature, speed sensors and injected faults, a page at a time"},
      {kDetails, "details", kFd, kWide, kBench, 0x7A0, 0x780, true, 48, kDetailsFd,
       "voltages, power analyser and injected faults"},
  });
}();

/// Whether each frame of a message holds one page, numbered by the first field.
constexpr bool is_paged(const MessageRow& row) noexcept {
  return row.fields.back().page != kEveryPage;
}

/// The row of a message in a variant of the profile for an axis, or null.
constexpr const MessageRow* find_message(Message message, bool fd, bool wide = false) noexcept {
  for (const MessageRow& row : kMessages) {
    if (row.message != message) continue;
    const bool has_variant = row.variant == Variant::kBoth || (row.variant == Variant::kFd) == fd;
    if (has_variant && (row.width == Width::kAny || (row.width == Width::kWide) == wide)) return &row;
  }
  return nullptr;
}

}  // namespace drivebench::can
