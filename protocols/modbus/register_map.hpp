#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "protocols/catalogue.hpp"
#include "protocols/modbus/codec.hpp"

/// The Modbus registers of an axis, written once: reads, writes, their checks, CSV and Markdown loop over
/// this table. Function codes 3 and 4 see the same registers; addresses count from 0.
namespace drivebench::modbus {

/// Register 0: the letters "DB".
inline constexpr std::uint16_t kMarker = 0x4442;
/// Register 1. An address never changes its meaning within a version.
inline constexpr std::uint16_t kMapVersion = 1;
/// Every register again, this much higher, with the words of 32-bit and 64-bit values the other way round.
inline constexpr std::uint16_t kMirrorOffset = 10'000;

inline constexpr std::uint16_t kProcessStart = 100;
inline constexpr std::uint16_t kSampleStart = 200;
inline constexpr std::uint16_t kCommandStart = 400;
inline constexpr std::uint16_t kParameterStart = 1000;

/// What a register says beside signals of the catalogue and parameters.
enum class Content : std::uint8_t {
  kSignal,   ///< the row `index` of the catalogue: scaled and saturated if it has 16 bits
  kLowBits,  ///< the low bits of an integer signal, which wrap around
  kMarkerWord,
  kVersionWord,
  kAxes,
  kAxis,
  kMirror,
  kBlocks,
  kBlockId,  ///< of block number `index`
  kBlockStart,
  kBlockLength,
  kFixedFloat,
  kFixedInteger,
  kMode,
  kWrites,
  kPeriod,
  kControlWord,
  kReferenceA,
  kReferenceB,
  kStatusWord,
  kLeaseKey,
  kRequest,
  kCommandMode,
  kCounter,
  kVoltageA,
  kVoltageB,
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
  double minimum;  ///< of the value; what lies outside is refused
  double maximum;
  std::string_view meaning;

  constexpr std::size_t size() const noexcept { return words_of(type); }
  constexpr std::size_t end() const noexcept { return address + size(); }
};

/// What a request of the command block may ask for.
enum class LeaseRequest : std::uint16_t { kNone = 0, kClearFaults = 1, kRelease = 2, kRenew = 3 };

/// What the mode register of the command block says.
enum class CommandMode : std::uint16_t { kOff = 0, kVoltage = 1, kZeroVoltage = 2, kDuty = 3 };

inline constexpr float kTestFloat = 1.2345678f;
inline constexpr std::int32_t kTestInteger = -123456789;
inline constexpr double kMaxVoltage = 1e6;  ///< a command beyond this is refused

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
/// A signal in a register of its own; the range is what 16 bits hold.
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

constexpr std::size_t sample_words() {
  std::size_t words = 4;  // the second snapshot
  for (const Signal& s : kSignals)
    words += s.type == SignalType::kReal ? 2 : 4;
  return words;
}

/// Every signal in the order of the catalogue, which begins with the tick, and the tick again.
inline constexpr auto kSample = [] {
  std::array<Row, kSignals.size() + 1> rows{};
  std::uint16_t address = kSampleStart;
  for (std::size_t i = 0; i < kSignals.size(); ++i) {
    const Signal& s = kSignals[i];
    const auto index = static_cast<std::uint16_t>(i);
    const Type type = s.type == SignalType::kReal     ? kFloat32
                      : s.type == SignalType::kSigned ? kSigned64
                                                      : kUnsigned64;
    rows[i] = {address, type, kSignal, index, false, s.name, s.unit, 1.0, s.minimum, s.maximum, s.meaning};
    address = static_cast<std::uint16_t>(rows[i].end());
  }
  rows.back() =
      low_bits(address, kUnsigned64, "tick", "snapshot", "the tick again: as at the start of the block");
  return rows;
}();

inline constexpr auto kCommand = std::to_array<Row>({
    written(400, kUnsigned16, kLeaseKey, "lease_key", "1", 1.0, 0.0, kAny16,
            "a number of your choice takes the lease for this connection, or takes it over from a connection "
            "that "
            "used the same number; 0 gives it back. Reads as 0 for others"),
    written(401, kUnsigned16, kRequest, "request", "enum", 1.0, 0.0, 3.0,
            "1 clear faults, 2 release the lease, 3 renew it; reads as 0"),
    written(402, kUnsigned16, kCommandMode, "command_mode", "enum", 1.0, 0.0, 3.0,
            "0 gates off, 1 voltages, 2 zero voltage, 3 duties: shares of the bus voltage"),
    written(403, kUnsigned32, kCounter, "command_counter", "1", 1.0, 0.0, 4294967295.0,
            "low bits of the tick of the sample that the command answers; writing it gives the command"),
    written(405, kFloat32, kVoltageA, "command_a", "V or 1", 1.0, -kMaxVoltage, kMaxVoltage,
            "voltage of phase a, or its duty in -1 .. 1"),
    written(407, kFloat32, kVoltageB, "command_b", "V or 1", 1.0, -kMaxVoltage, kMaxVoltage,
            "voltage of phase b, or its duty in -1 .. 1"),
    fixed(
        409, kUnsigned16, kLeaseStatus, "lease_status", "enum",
        "who holds the lease: 0 nobody, 1 this connection, 2 another Modbus connection, 3 another transport"),
    fixed(
        410, kUnsigned16, kLastRefusal, "last_refusal", "enum",
        "why the last write here was refused: 0 none yet, 2 not the owner, 3 owned by another, 4 not finite, "
        "5 latched fault, 6 stale or answered already, 7 busy, 8 out of range, 9 wrong mode"),
});

/// All parts in one array, sorted by address.
inline constexpr auto kFixedRows = [] {
  std::array<Row, kHeader.size() + kProcess.size() + kSample.size() + kCommand.size()> rows{};
  std::size_t n = 0;
  const auto append = [&](const auto& part) {
    for (const Row& row : part)
      rows[n++] = row;
  };
  append(kHeader);
  append(kProcess);
  append(kSample);
  append(kCommand);
  return rows;
}();

constexpr bool sorted_and_disjoint() {
  for (std::size_t i = 1; i < kFixedRows.size(); ++i) {
    if (kFixedRows[i].address < kFixedRows[i - 1].end()) return false;
  }
  return true;
}
static_assert(sorted_and_disjoint());
static_assert(kSample.back().end() == kSampleStart + sample_words());
static_assert(kSample.back().end() <= kCommandStart, "the sample block has outgrown its place");
static_assert(kFixedRows.back().end() <= kParameterStart);

constexpr std::uint16_t length_of(std::span<const Row> rows) {
  return static_cast<std::uint16_t>(rows.back().end() - rows.front().address);
}

}  // namespace map_detail

inline constexpr std::uint16_t kSampleLength = map_detail::length_of(map_detail::kSample);

/// Registers without a gap. Reads and writes stay within one block.
struct Block {
  std::uint16_t id;
  std::uint16_t start;
  std::uint16_t length;
  std::string_view name;
};

/// A parameter as the owner of the map describes it; the strings live as long as the map.
struct ParameterInfo {
  std::string_view name;
  std::string_view unit;
  double minimum;
  double maximum;
  bool live;
  std::string_view meaning;
};

/// One coil or discrete input.
struct Bit {
  std::string_view name;
  std::string_view meaning;
};

/// Coils, by address. Writing needs the lease.
enum class Coil : std::uint8_t { kClearFaults, kLease };
inline constexpr auto kCoils = std::to_array<Bit>({
    {"clear_faults", "1 clears the latched faults; reads as 0"},
    {"lease", "1 while this connection holds the lease; writing 1 renews it, 0 gives it back"},
});

/// Discrete inputs: the low bits of the fault word, then these, one bit of the control state each and the
/// levels of the encoder.
inline constexpr std::size_t kFaultInputs = 16;
inline constexpr std::size_t kStateInputs = 5;
inline constexpr std::size_t kEncoderInputs = 6;
inline constexpr auto kOtherInputs = std::to_array<Bit>({
    {"state_idle", "nobody commands the axis"},
    {"state_run", "commands arrive"},
    {"state_hold", "commands are missing, the last one holds"},
    {"state_timeout", "latched: the controller left or fell silent"},
    {"state_fault", "latched: a fault"},
    {"encoder_a", "level of track A"},
    {"encoder_b", "level of track B"},
    {"encoder_z", "level of the index"},
    {"encoder_down", "the last edge counted down"},
    {"encoder_turned", "the direction has changed"},
    {"encoder_period", "the edge period is valid"},
});
static_assert(kOtherInputs.size() == kStateInputs + kEncoderInputs);
inline constexpr std::size_t kDiscreteInputs = kFaultInputs + kOtherInputs.size();

/// The state of a discrete input.
constexpr bool discrete_input(std::size_t address, const Sample& sample) noexcept {
  if (address < kFaultInputs) return (sample.faults >> address & 1) != 0;
  address -= kFaultInputs;
  if (address < kStateInputs) return sample.state == address;
  return (sample.encoder_levels >> (address - kStateInputs) & 1) != 0;
}

/// The bits of a row that shows a signal.
std::uint64_t signal_bits(const Row& row, const Sample& sample) noexcept;

/// The sample in the registers of the sample block, kSampleLength words from kSampleStart on (ABCD). Real
/// values have been rounded to float32 on the way.
Sample read_sample(std::span<const std::uint16_t> words) noexcept;

/// The whole map of an axis: the fixed rows and its parameters.
class RegisterMap {
 public:
  /// Without `writable` no register may be written.
  RegisterMap(std::span<const ParameterInfo> parameters, bool writable);

  std::span<const Row> rows() const noexcept { return rows_; }
  std::span<const Block> blocks() const noexcept { return blocks_; }
  bool writable() const noexcept { return writable_; }

  /// Registers asked for, all within one block.
  struct Range {
    std::span<const Row> rows;  ///< that have at least one register among them
    WordOrder order;
    std::uint16_t first;  ///< without the offset of the mirror
    std::uint16_t count;
  };
  /// Nothing if a register among them does not exist or they lie in two blocks.
  std::optional<Range> find(std::uint16_t address, std::uint16_t count) const noexcept;

  /// Whether these are whole values that may all be written.
  bool may_write(const Range& range) const noexcept;

 private:
  std::vector<Row> rows_;
  std::vector<Block> blocks_;
  bool writable_;
};

/// Whether every value, in registers that may_write(), is finite and in its range.
bool values_fit(const RegisterMap::Range& range, std::span<const std::uint16_t> words) noexcept;

}  // namespace drivebench::modbus
