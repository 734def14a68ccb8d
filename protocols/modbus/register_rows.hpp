#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "protocols/modbus/codec.hpp"
#include "protocols/refusals.hpp"
#include "protocols/signals/catalogue.hpp"

/// The rows of the register map that are the same for every axis.
namespace drivebench::modbus {

/// Register 0: the letters "DB".
inline constexpr std::uint16_t kMarker = 0x4442;
/// Register 1. An address never changes its meaning within a version.
inline constexpr std::uint16_t kMapVersion = 1;
/// The offset of the mirror: every register again, with the words of 32-bit and 64-bit values in reverse
/// order.
inline constexpr std::uint16_t kMirrorOffset = 10'000;

inline constexpr std::uint16_t kProcessStart = 100;
inline constexpr std::uint16_t kSampleStart = 200;
inline constexpr std::uint16_t kMoreSampleStart = 286;
inline constexpr std::uint16_t kRailSampleStart = 340;
inline constexpr std::uint16_t kComparatorStart = 360;
inline constexpr std::uint16_t kConverterStart = 440;
inline constexpr std::uint16_t kPositionStart = 490;
inline constexpr std::uint16_t kCommandStart = 400;
inline constexpr std::uint16_t kParameterStart = 1000;

/// The content of a register.
enum class Content : std::uint8_t {
  kSignal,   ///< the row `index` of the catalogue: scaled and saturated if it has 16 bits
  kLowBits,  ///< the low bits of an integer signal; they wrap around
  kMarkerWord,
  kVersionWord,
  kAxes,
  kAxis,
  kMirror,
  kBlocks,
  kMoreBlocks,
  kFurtherBlocks,
  kBlockId,  ///< of block number `index`
  kBlockStart,
  kBlockLength,
  kFixedFloat,
  kFixedInteger,
  kMode,
  kWrites,
  kPeriod,
  kMachineKind,
  kConnection,
  kTerminals,
  kControlWord,
  kReferenceMode,
  kReferenceA,
  kReferenceB,
  kReferenceC,
  kReferenceField,
  kStatusWord,
  kLeaseKey,
  kRequest,
  kCommandMode,
  kCounter,
  kSetpointA,
  kSetpointB,
  kSetpointC,
  kSetpointField,
  kLegsOff,
  kLeaseStatus,
  kLastRefusal,
  kParameter,  ///< row `index` of the parameters
};

/// One value.
struct Row {
  std::uint16_t address;  ///< of its first register
  Type type;
  Content content;
  std::uint16_t index;
  bool writable;
  std::string_view name;
  std::string_view unit;
  double scale;    ///< unit of the value per count
  double minimum;  ///< of the value; a write outside the range is refused
  double maximum;
  std::string_view meaning;

  constexpr std::size_t size() const noexcept { return words_of(type); }
  constexpr std::size_t end() const noexcept { return address + size(); }
};

/// The codes of the request register in the command block.
enum class AxisRequest : std::uint16_t { kNone = 0, kClearFaults = 1, kRelease = 2, kRenew = 3 };

/// The codes of the mode register in the command block.
enum class CommandMode : std::uint16_t {
  kOff = 0,
  kVoltage = 1,
  kZeroVoltage = 2,
  kDuty = 3,  ///< counts the legs of a star from the middle of the link
  kCurrent = 4,
  kLegDuty = 5,
};

/// The quantity of the references in the process data.
enum class ReferenceMode : std::uint16_t { kVoltage = 0, kCurrent = 1 };

inline constexpr float kTestFloat = 1.2345678f;
inline constexpr std::int32_t kTestInteger = -123456789;
inline constexpr double kMaxSetpoint = 1e6;  ///< a larger set-point is refused [V] or [A]

namespace map_detail {

constexpr double kAny16 = 65535.0;

constexpr Row fixed(std::uint16_t address, Type type, Content content, std::string_view name,
                    std::string_view unit, std::string_view meaning, std::uint16_t index = 0) {
  return {address, type, content, index, false, name, unit, 1.0, 0.0, kAny16, meaning};
}
constexpr Row written(std::uint16_t address, Type type, Content content, std::string_view name,
                      std::string_view unit, double scale, double minimum, double maximum,
                      std::string_view meaning) {
  return {address, type, content, 0, true, name, unit, scale, minimum, maximum, meaning};
}
constexpr std::uint16_t row_of(std::string_view signal) {
  return static_cast<std::uint16_t>(find_signal(signal) - kSignals.data());
}
/// A scaled signal in 16 bits; its range is that of the 16 bits.
constexpr Row signal(std::uint16_t address, Type type, std::string_view name, double scale) {
  const Signal& s = *find_signal(name);
  const bool is_signed = type == Type::kSigned16;
  return {address,
          type,
          Content::kSignal,
          row_of(name),
          false,
          s.name,
          s.unit,
          scale,
          is_signed ? -32767 * scale : 0.0,
          (is_signed ? 32767 : 65534) * scale,
          s.meaning};
}
constexpr Row low_bits(std::uint16_t address, Type type, std::string_view signal, std::string_view name,
                       std::string_view meaning) {
  return {
      address, type,   Content::kLowBits, row_of(signal), false, name, find_signal(signal)->unit, 1.0, 0.0,
      0.0,     meaning};
}

using enum Type;
using enum Content;

inline constexpr auto kHeader = std::to_array<Row>({
    fixed(0, kUnsigned16, kMarkerWord, "marker", "1", "0x4442, the letters DB"),
    fixed(1, kUnsigned16, kVersionWord, "map_version", "1", "version of this map"),
    fixed(2, kUnsigned16, kAxes, "axes", "1", "number of axes; axis i answers at unit id i + 1"),
    fixed(3, kUnsigned16, kAxis, "axis", "1", "which of them this is, from 0"),
    fixed(4, kUnsigned16, kMirror, "mirror_offset", "1",
          "every register again so much higher, with the words of a value in the order CDAB"),
    fixed(5, kUnsigned16, kBlocks, "blocks", "1", "number of blocks that follow here: id, start, length"),
    fixed(6, kUnsigned16, kBlockId, "process_id", "1", "1: process data", 0),
    fixed(7, kUnsigned16, kBlockStart, "process_start", "1", "its first register", 0),
    fixed(8, kUnsigned16, kBlockLength, "process_length", "1", "its number of registers", 0),
    fixed(9, kUnsigned16, kBlockId, "sample_id", "1", "2: every signal of the sample", 1),
    fixed(10, kUnsigned16, kBlockStart, "sample_start", "1", "its first register", 1),
    fixed(11, kUnsigned16, kBlockLength, "sample_length", "1", "its number of registers", 1),
    fixed(12, kUnsigned16, kBlockId, "command_id", "1", "3: lease and command", 2),
    fixed(13, kUnsigned16, kBlockStart, "command_start", "1", "its first register", 2),
    fixed(14, kUnsigned16, kBlockLength, "command_length", "1", "its number of registers", 2),
    fixed(15, kUnsigned16, kBlockId, "parameter_id", "1", "4: parameters", 3),
    fixed(16, kUnsigned16, kBlockStart, "parameter_start", "1", "its first register", 3),
    fixed(17, kUnsigned16, kBlockLength, "parameter_length", "1", "its number of registers", 3),
    fixed(18, kFloat32, kFixedFloat, "test_float", "1", "always 1.2345678"),
    fixed(20, kSigned32, kFixedInteger, "test_integer", "1", "always -123456789"),
    low_bits(22, kUnsigned64, "tick", "test_tick", "the tick, for trying 64-bit values"),
    fixed(26, kUnsigned16, kMode, "mode", "enum", "0 real time, 1 lockstep, 2 free"),
    fixed(27, kUnsigned16, kWrites, "writes_allowed", "enum", "0: the configuration allows no writes"),
    fixed(28, kUnsigned32, kPeriod, "period_ns", "ns", "sample period"),
    fixed(30, kUnsigned16, kMoreBlocks, "more_blocks", "1", "number of blocks that follow here, as above"),
    fixed(31, kUnsigned16, kBlockId, "more_process_id", "1", "5: process data of all terminals", 4),
    fixed(32, kUnsigned16, kBlockStart, "more_process_start", "1", "its first register", 4),
    fixed(33, kUnsigned16, kBlockLength, "more_process_length", "1", "its number of registers", 4),
    fixed(34, kUnsigned16, kBlockId, "more_sample_id", "1",
          "6: the sample goes on; it follows on the sample without a gap", 5),
    fixed(35, kUnsigned16, kBlockStart, "more_sample_start", "1", "its first register", 5),
    fixed(36, kUnsigned16, kBlockLength, "more_sample_length", "1", "its number of registers", 5),
    fixed(37, kUnsigned16, kBlockId, "more_command_id", "1", "7: lease and command for all terminals", 6),
    fixed(38, kUnsigned16, kBlockStart, "more_command_start", "1", "its first register", 6),
    fixed(39, kUnsigned16, kBlockLength, "more_command_length", "1", "its number of registers", 6),
    fixed(40, kUnsigned16, kMachineKind, "machine_kind", "1",
          "number of the kind of machine; the parameters are those of the kind"),
    fixed(41, kUnsigned16, kConnection, "connection", "enum",
          "of the stator: 0 two-phase, 1 star, 2 independent phases, 3 armature"),
    fixed(42, kUnsigned16, kTerminals, "terminals", "bits", "what can be commanded: 1 a, 2 b, 4 c, 8 field"),
    fixed(43, kUnsigned16, kFurtherBlocks, "further_blocks", "1", "number of blocks that follow, as above"),
    fixed(44, kUnsigned16, kBlockId, "legs_id", "1", "8: legs of a command, right after block 7", 7),
    fixed(45, kUnsigned16, kBlockStart, "legs_start", "1", "its first register", 7),
    fixed(46, kUnsigned16, kBlockLength, "legs_length", "1", "its number of registers", 7),
    fixed(47, kUnsigned16, kBlockId, "rail_sample_id", "1", "9: terminals against the negative rail", 8),
    fixed(48, kUnsigned16, kBlockStart, "rail_sample_start", "1", "its first register", 8),
    fixed(49, kUnsigned16, kBlockLength, "rail_sample_length", "1", "its number of registers", 8),
    fixed(50, kUnsigned16, kBlockId, "comparator_id", "1", "10: comparators of the terminals", 9),
    fixed(51, kUnsigned16, kBlockStart, "comparator_start", "1", "its first register", 9),
    fixed(52, kUnsigned16, kBlockLength, "comparator_length", "1", "its number of registers", 9),
    fixed(53, kUnsigned16, kBlockId, "converter_id", "1", "11: numbers of converters and timers", 10),
    fixed(54, kUnsigned16, kBlockStart, "converter_start", "1", "its first register", 10),
    fixed(55, kUnsigned16, kBlockLength, "converter_length", "1", "its number of registers", 10),
    fixed(56, kUnsigned16, kBlockId, "position_id", "1", "12: absolute encoder and capture of Hall edges",
          11),
    fixed(57, kUnsigned16, kBlockStart, "position_start", "1", "its first register", 11),
    fixed(58, kUnsigned16, kBlockLength, "position_length", "1", "its number of registers", 11),
});

inline constexpr auto kProcess = std::to_array<Row>({
    low_bits(100, kUnsigned16, "tick", "snapshot", "low bits of the tick; equal at both ends of the block"),
    written(101, kUnsigned16, kControlWord, "control_word", "bits", 1.0, 0.0, kAny16,
            "as CiA 402: 1 switch on, 2 enable voltage, 4 quick stop when 0, 8 enable operation, 128 rising: "
            "clear faults. 6 makes ready, then 15 enables"),
    written(102, kSigned16, kReferenceA, "reference_a", "V", 0.01, -327.68, 327.67,
            "voltage of phase a while operation is enabled"),
    written(103, kSigned16, kReferenceB, "reference_b", "V", 0.01, -327.68, 327.67,
            "voltage of phase b while operation is enabled"),
    fixed(104, kUnsigned16, kStatusWord, "status_word", "bits",
          "as CiA 402: 1 ready, 2 switched on, 4 operation enabled, 8 fault, 16 voltage there, 32 no quick "
          "stop, "
          "64 switch on disabled, 128 warning, 512 remote, 2048 voltage limit"),
    signal(105, kSigned16, "speed_rad_s", 0.1),
    signal(106, kSigned16, "i_a_a", 0.01),
    signal(107, kSigned16, "i_b_a", 0.01),
    signal(108, kSigned16, "torque_nm", 0.01),
    signal(109, kUnsigned16, "bus_voltage_v", 0.1),
    low_bits(110, kUnsigned16, "faults", "faults", "low bits of the fault word"),
    signal(111, kUnsigned16, "command_age_ticks", 1.0),
    low_bits(112, kUnsigned16, "tick", "snapshot", "as at the start of the block"),
});

/// Process data for all terminals; the registers of the block above stand here once more.
inline constexpr auto kMoreProcess = std::to_array<Row>({
    low_bits(120, kUnsigned16, "tick", "more_snapshot",
             "low bits of the tick; equal at both ends of the block"),
    written(121, kUnsigned16, kControlWord, "more_control_word", "bits", 1.0, 0.0, kAny16, "as control_word"),
    written(122, kUnsigned16, kReferenceMode, "reference_mode", "enum", 1.0, 0.0, 1.0,
            "what the references are: 0 voltages, 1 currents"),
    written(123, kSigned16, kReferenceA, "more_reference_a", "V or A", 0.01, -327.68, 327.67,
            "as reference_a, or its current"),
    written(124, kSigned16, kReferenceB, "more_reference_b", "V or A", 0.01, -327.68, 327.67,
            "as reference_b, or its current"),
    written(125, kSigned16, kReferenceC, "reference_c", "V or A", 0.01, -327.68, 327.67,
            "voltage or current of phase c while operation is enabled"),
    written(126, kSigned16, kReferenceField, "reference_field", "V or A", 0.01, -327.68, 327.67,
            "voltage or current of the field winding while operation is enabled"),
    fixed(127, kUnsigned16, kStatusWord, "more_status_word", "bits", "as status_word"),
    signal(128, kSigned16, "speed_rad_s", 0.1),
    signal(129, kSigned16, "i_a_a", 0.01),
    signal(130, kSigned16, "i_b_a", 0.01),
    signal(131, kSigned16, "i_c_a", 0.01),
    signal(132, kSigned16, "i_f_a", 0.01),
    signal(133, kSigned16, "torque_nm", 0.01),
    signal(134, kUnsigned16, "bus_voltage_v", 0.1),
    signal(135, kUnsigned16, "temperature_k", 0.1),
    signal(136, kUnsigned16, "hall_lines", 1.0),
    low_bits(137, kUnsigned16, "faults", "more_faults", "low bits of the fault word"),
    low_bits(138, kUnsigned32, "injected", "injected_low", "low bits of the injected faults in force"),
    signal(140, kUnsigned16, "command_age_ticks", 1.0),
    low_bits(141, kUnsigned16, "tick", "more_snapshot", "as at the start of the block"),
});

// The numbers of signals, in the order of the catalogue, in the blocks of the sample. A block never grows.
inline constexpr std::size_t kFirstSignals = 28;
inline constexpr std::size_t kMoreSignals = 21;
inline constexpr std::size_t kRailSignals = 6;
inline constexpr std::size_t kComparatorSignals = 10;
inline constexpr std::size_t kConverterSignals = 10;
inline constexpr std::size_t kPositionSignals = 4;
inline constexpr std::size_t kBeforeRail = kFirstSignals + kMoreSignals;
inline constexpr std::size_t kBeforeComparators = kBeforeRail + kRailSignals;
inline constexpr std::size_t kBeforeConverters = kBeforeComparators + kComparatorSignals;
inline constexpr std::size_t kBeforePosition = kBeforeConverters + kConverterSignals;
static_assert(kBeforePosition + kPositionSignals == kSignals.size(), "others need a new block");

constexpr Row sample_row(std::size_t index, std::uint16_t address) {
  const Signal& s = kSignals[index];
  const Type type = s.type == SignalType::kReal     ? kFloat32
                    : s.type == SignalType::kSigned ? kSigned64
                                                    : kUnsigned64;
  const auto row = static_cast<std::uint16_t>(index);
  return {address, type, kSignal, row, false, s.name, s.unit, 1.0, s.minimum, s.maximum, s.meaning};
}

/// The first signals of the catalogue, which begins with the tick, and the tick again.
inline constexpr auto kSample = [] {
  std::array<Row, kFirstSignals + 1> rows{};
  std::uint16_t address = kSampleStart;
  for (std::size_t i = 0; i < kFirstSignals; ++i) {
    rows[i] = sample_row(i, address);
    address = static_cast<std::uint16_t>(rows[i].end());
  }
  rows.back() =
      low_bits(address, kUnsigned64, "tick", "snapshot", "the tick again: as at the start of the block");
  return rows;
}();

/// The next signals: sensors before truth, so that one request can read these sensors; then the tick again.
inline constexpr auto kMoreSample = [] {
  std::array<Row, kMoreSignals + 1> rows{};
  std::uint16_t address = kMoreSampleStart;
  std::size_t n = 0;
  for (const bool truth : {false, true}) {
    for (std::size_t i = kFirstSignals; i < kFirstSignals + kMoreSignals; ++i) {
      if ((kSignals[i].kind == SignalKind::kTruth) != truth) continue;
      rows[n] = sample_row(i, address);
      address = static_cast<std::uint16_t>(rows[n++].end());
    }
  }
  rows[n] = low_bits(address, kUnsigned64, "tick", "last_snapshot",
                     "the tick again: as at the start of the sample");
  return rows;
}();

/// The tick under this name and so many signals of the catalogue.
template <std::size_t kCount>
constexpr std::array<Row, kCount + 1> later_block(std::uint16_t start, std::size_t first,
                                                  std::string_view snapshot, std::string_view meaning) {
  std::array<Row, kCount + 1> rows{};
  rows[0] = low_bits(start, kUnsigned64, "tick", snapshot, meaning);
  for (std::size_t i = 0; i < kCount; ++i)
    rows[i + 1] = sample_row(first + i, static_cast<std::uint16_t>(rows[i].end()));
  return rows;
}

inline constexpr auto kRailSample =
    later_block<kRailSignals>(kRailSampleStart, kBeforeRail, "rail_snapshot", "the tick of these voltages");
inline constexpr auto kComparators = later_block<kComparatorSignals>(
    kComparatorStart, kBeforeComparators, "comparator_snapshot", "the tick of these comparators");
inline constexpr auto kConverters = later_block<kConverterSignals>(
    kConverterStart, kBeforeConverters, "converter_snapshot", "the tick of these numbers");
inline constexpr auto kPosition = later_block<kPositionSignals>(
    kPositionStart, kBeforePosition, "position_snapshot", "the tick of these sensors");

inline constexpr std::string_view kModeMeaning =
    "0 gates off, 1 voltages, 2 zero voltage, 3 duties from the middle, 4 currents, 5 duties of legs";

inline constexpr auto kCommand = std::to_array<Row>({
    written(400, kUnsigned16, kLeaseKey, "lease_key", "1", 1.0, 0.0, kAny16,
            "a number of your choice takes the lease for this connection, or takes it over from a connection "
            "that "
            "used the same number; 0 gives it back. Reads as 0 for others"),
    written(401, kUnsigned16, kRequest, "request", "enum", 1.0, 0.0, 3.0,
            "1 clear faults, 2 release the lease, 3 renew it; reads as 0"),
    written(402, kUnsigned16, kCommandMode, "command_mode", "enum", 1.0, 0.0, 5.0, kModeMeaning),
    written(403, kUnsigned32, kCounter, "command_counter", "1", 1.0, 0.0, 4294967295.0,
            "low bits of the tick of the sample that the command answers; writing it gives the command"),
    written(405, kFloat32, kSetpointA, "command_a", "V, 1 or A", 1.0, -kMaxSetpoint, kMaxSetpoint,
            "voltage of phase a, or its duty, or its current"),
    written(407, kFloat32, kSetpointB, "command_b", "V, 1 or A", 1.0, -kMaxSetpoint, kMaxSetpoint,
            "voltage of phase b, or its duty, or its current"),
    fixed(409, kUnsigned16, kLeaseStatus, "lease_status", "enum",
          "holder of the lease: 0 none, 1 this connection, 2 another Modbus connection, 3 another transport"),
    fixed(410, kUnsigned16, kLastRefusal, "last_refusal", "enum", kLastRefusalMeaning),
});

/// The command registers for all terminals, so that one request writes them all.
inline constexpr auto kMoreCommand = std::to_array<Row>({
    written(420, kUnsigned16, kLeaseKey, "more_lease_key", "1", 1.0, 0.0, kAny16, "as lease_key"),
    written(421, kUnsigned16, kRequest, "more_request", "enum", 1.0, 0.0, 3.0, "as request"),
    written(422, kUnsigned16, kCommandMode, "more_command_mode", "enum", 1.0, 0.0, 5.0, kModeMeaning),
    written(423, kUnsigned32, kCounter, "more_command_counter", "1", 1.0, 0.0, 4294967295.0,
            "as command_counter; writing it gives the command"),
    written(425, kFloat32, kSetpointA, "more_command_a", "V, 1 or A", 1.0, -kMaxSetpoint, kMaxSetpoint,
            "as command_a"),
    written(427, kFloat32, kSetpointB, "more_command_b", "V, 1 or A", 1.0, -kMaxSetpoint, kMaxSetpoint,
            "as command_b"),
    written(429, kFloat32, kSetpointC, "command_c", "V, 1 or A", 1.0, -kMaxSetpoint, kMaxSetpoint,
            "voltage of phase c, or its duty, or its current"),
    written(431, kFloat32, kSetpointField, "command_field", "V, 1 or A", 1.0, -kMaxSetpoint, kMaxSetpoint,
            "voltage of the field winding, or its duty, or its current"),
});

/// What a command says of the legs; one request writes it together with the registers above.
inline constexpr auto kLegs = std::to_array<Row>({
    written(433, kUnsigned16, kLegsOff, "legs_off", "bits", 1.0, 0.0, 7.0,
            "legs that are off, whatever the mode gives the others: 1 a, 2 b, 4 c"),
});

/// All parts in one array, sorted by address.
inline constexpr auto kFixedRows = [] {
  std::array<Row, kHeader.size() + kProcess.size() + kMoreProcess.size() + kSample.size() +
                      kMoreSample.size() + kRailSample.size() + kComparators.size() + kCommand.size() +
                      kMoreCommand.size() + kLegs.size() + kConverters.size() + kPosition.size()>
      rows{};
  std::size_t n = 0;
  const auto append = [&](const auto& part) {
    for (const Row& row : part)
      rows[n++] = row;
  };
  append(kHeader);
  append(kProcess);
  append(kMoreProcess);
  append(kSample);
  append(kMoreSample);
  append(kRailSample);
  append(kComparators);
  append(kCommand);
  append(kMoreCommand);
  append(kLegs);
  append(kConverters);
  append(kPosition);
  return rows;
}();

constexpr bool sorted_and_disjoint() {
  for (std::size_t i = 1; i < kFixedRows.size(); ++i) {
    if (kFixedRows[i].address < kFixedRows[i - 1].end()) return false;
  }
  return true;
}
static_assert(sorted_and_disjoint());
static_assert(kSample.back().end() == kMoreSampleStart, "one request reads on from one block to the next");
static_assert(kFixedRows.back().end() <= kParameterStart);

constexpr std::uint16_t length_of(std::span<const Row> rows) {
  return static_cast<std::uint16_t>(rows.back().end() - rows.front().address);
}

}  // namespace map_detail

}  // namespace drivebench::modbus
