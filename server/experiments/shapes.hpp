#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <variant>
#include <vector>

#include "plant/tick.hpp"
#include "plant/windings.hpp"
#include "server/experiments/table.hpp"

/// The inputs of experiments: pure functions of the tick, with the bench's own cosine, so that the same
/// request gives the same bits everywhere. bench.proto defines the shapes.
namespace drivebench {

struct ConstantShape {
  double value;
};
struct RampShape {
  double from;
  double to;
};
struct SineShape {
  double amplitude;
  double frequency_hz;
  double phase_rad;
  double offset;
};
struct ThreePhaseShape {
  double amplitude;
  double frequency_hz;
  double phase_rad;
  double rise_s;
};
struct ChirpShape {
  double amplitude;
  double from_hz;
  double to_hz;
};
struct PrbsShape {
  double amplitude;
  Tick bit_ticks;
  std::uint64_t first_bit;
  const std::vector<bool>* bits;  ///< one period, of maximum_length_sequence()
};
struct MultisineShape {
  double amplitude;
  double base_hz;
  std::vector<std::uint32_t> harmonics;
};
struct TableShape {
  std::shared_ptr<const TableView> table;
  bool interpolate;
};

enum class InputChannel : std::uint8_t { kA, kB, kC, kField, kD, kQ, kPhases };
inline constexpr std::size_t kInputChannels = 6;  ///< without kPhases

/// A shape, in force from tick `start` to before `end`.
struct InputShape {
  InputChannel channel;  ///< kPhases for a ThreePhaseShape and no other
  Tick start;
  Tick end;
  std::variant<ConstantShape, RampShape, SineShape, ThreePhaseShape, ChirpShape, PrbsShape, MultisineShape,
               TableShape>
      shape;
};

/// One value for each channel.
using InputValues = std::array<double, kInputChannels>;

/// Adds the value of the shape at the tick. `connection` gives the lag of phases b and c in a
/// ThreePhaseShape.
void add_shape(const InputShape& shape, Tick tick, double period_s, Connection connection,
               InputValues& values) noexcept;

/// One period of a maximum-length sequence: 2^order - 1 bits, 2^(order-1) of them set. `order` is 3 to 20.
/// The first call computes the sequences of all orders, in some milliseconds, and keeps them (256 KiB).
inline constexpr std::uint32_t kMinPrbsOrder = 3;
inline constexpr std::uint32_t kMaxPrbsOrder = 20;
const std::vector<bool>& maximum_length_sequence(std::uint32_t order);

}  // namespace drivebench
