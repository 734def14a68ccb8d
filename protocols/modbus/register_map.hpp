#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "protocols/modbus/register_rows.hpp"

/// The Modbus registers of an axis, written once: reads, writes, their checks, CSV and Markdown loop over
/// this table. Function codes 3 and 4 read the same registers; addresses count from 0.
namespace drivebench::modbus {

inline constexpr std::uint16_t kSampleLength = map_detail::length_of(map_detail::kSample);

/// The most registers from kSampleStart on that one request can read in whole values; they include every
/// sensor but those of the later blocks, from kRailSampleStart on.
inline constexpr std::uint16_t kSensorsLength = [] {
  std::size_t end = kMoreSampleStart;
  for (const Row& row : map_detail::kMoreSample) {
    if (row.end() > kSampleStart + 125u) break;
    end = row.end();
  }
  return static_cast<std::uint16_t>(end - kSampleStart);
}();

/// Consecutive registers. A read or write across a gap is refused.
struct Block {
  std::uint16_t id;
  std::uint16_t start;
  std::uint16_t length;
  std::string_view name;
};

/// A parameter in the map. The strings must outlive the map.
struct ParameterInfo {
  std::string_view name;
  std::string_view unit;
  double minimum;
  double maximum;
  bool live;
  std::string_view meaning;
};

/// A coil or discrete input.
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

/// Discrete inputs in order: the low bits of the fault word, one bit for each control state, the levels of
/// the encoder, the Hall lines, the low bits of the injected faults.
inline constexpr std::size_t kFaultInputs = 16;
inline constexpr std::size_t kStateInputs = 6;
inline constexpr std::size_t kEncoderInputs = 6;
inline constexpr auto kOtherInputs = std::to_array<Bit>({
    {"state_idle", "no controller commands the axis"},
    {"state_run", "commands arrive"},
    {"state_hold", "commands are missing, the last one holds"},
    {"state_timeout", "latched: the controller left or fell silent"},
    {"state_fault", "latched: a fault"},
    {"state_ready", "the first commands arrive, the axis is not armed yet"},
    {"encoder_a", "level of track A"},
    {"encoder_b", "level of track B"},
    {"encoder_z", "level of the index"},
    {"encoder_down", "the last edge counted down"},
    {"encoder_turned", "the direction has changed"},
    {"encoder_period", "the edge period is valid"},
    {"hall_1", "Hall line 1"},
    {"hall_2", "Hall line 2"},
    {"hall_3", "Hall line 3"},
});
inline constexpr std::size_t kHallInputs = 3;
static_assert(kOtherInputs.size() == kStateInputs + kEncoderInputs + kHallInputs);

inline constexpr std::size_t kFirstInjectedInput = kFaultInputs + kOtherInputs.size();
inline constexpr std::size_t kInjectedInputs = 32;
inline constexpr std::size_t kDiscreteInputs = kFirstInjectedInput + kInjectedInputs;

/// The value of a discrete input.
constexpr bool discrete_input(std::size_t address, const Sample& sample) noexcept {
  if (address < kFaultInputs) return (sample.faults >> address & 1) != 0;
  address -= kFaultInputs;
  if (address < kStateInputs) return sample.state == address;
  address -= kStateInputs;
  if (address < kEncoderInputs) return (sample.encoder_levels >> address & 1) != 0;
  address -= kEncoderInputs;
  if (address < kHallInputs) return (sample.hall_lines >> address & 1) != 0;
  return (sample.injected >> (address - kHallInputs) & 1) != 0;
}

/// The register bits of a signal.
std::uint64_t signal_bits(const Row& row, const Sample& sample) noexcept;

/// Decodes the registers from kSampleStart on (ABCD) into a sample, as far as the words reach. Registers hold
/// real values as float32.
Sample read_sample(std::span<const std::uint16_t> words) noexcept;

/// The map of an axis: the fixed rows, then the parameters in the given order.
class RegisterMap {
 public:
  /// With `writable` false every register is read-only.
  RegisterMap(std::span<const ParameterInfo> parameters, bool writable);

  std::span<const Row> rows() const noexcept { return rows_; }
  std::span<const Block> blocks() const noexcept { return blocks_; }
  /// The number of blocks in the first and in the second list of the header; the third has the others.
  static constexpr std::size_t kFirstBlocks = 4;
  static constexpr std::size_t kMoreBlocks = 3;
  bool writable() const noexcept { return writable_; }

  /// The registers of a request, without a gap.
  struct Range {
    std::span<const Row> rows;  ///< rows with at least one of the registers
    WordOrder order;
    std::uint16_t first;  ///< without the offset of the mirror
    std::uint16_t count;
  };
  /// The registers from `address` on; nothing if one of them does not exist.
  std::optional<Range> find(std::uint16_t address, std::uint16_t count) const noexcept;

  /// Whether the registers are whole values, all of them writable.
  bool may_write(const Range& range) const noexcept;

 private:
  std::vector<Row> rows_;
  std::vector<Block> blocks_;
  bool writable_;
};

/// Whether every value is finite and in its range. may_write() must hold for the registers.
bool values_fit(const RegisterMap::Range& range, std::span<const std::uint16_t> words) noexcept;

}  // namespace drivebench::modbus
