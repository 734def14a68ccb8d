#include "server/experiments/shapes.hpp"

#include <cmath>

#include "plant/math/trig.hpp"

namespace drivebench {
namespace {

constexpr double kPi = 0x1.921fb54442d18p+1;

/// The angle of this number of turns, reduced to one turn, so that the cosine keeps its precision in long
/// runs.
double angle_of(double turns) noexcept {
  return kTurnRad * (turns - std::floor(turns));
}

/// A time after the start of a shape, in seconds and in ticks; `length_s` is the length of the shape.
struct Moment {
  Tick ticks;
  double tau_s;
  double length_s;
};

double value_of(const ConstantShape& s, const Moment&) noexcept {
  return s.value;
}

double value_of(const RampShape& s, const Moment& m) noexcept {
  return s.from + (s.to - s.from) * (m.tau_s / m.length_s);
}

double value_of(const SineShape& s, const Moment& m) noexcept {
  return s.offset + s.amplitude * sine(angle_of(s.frequency_hz * m.tau_s) + s.phase_rad);
}

double value_of(const ChirpShape& s, const Moment& m) noexcept {
  const double mean_hz = s.from_hz + 0.5 * (s.to_hz - s.from_hz) * (m.tau_s / m.length_s);
  return s.amplitude * sine(angle_of(mean_hz * m.tau_s));
}

double value_of(const PrbsShape& s, const Moment& m) noexcept {
  const std::uint64_t bit = s.first_bit + static_cast<std::uint64_t>(m.ticks / s.bit_ticks);
  return (*s.bits)[bit % s.bits->size()] ? s.amplitude : -s.amplitude;
}

double value_of(const MultisineShape& s, const Moment& m) noexcept {
  const auto count = static_cast<double>(s.harmonics.size());
  double sum = 0.0;
  for (std::size_t i = 0; i < s.harmonics.size(); ++i) {
    const auto n = static_cast<double>(i + 1);
    const double schroeder_turns = -0.5 * n * (n - 1.0) / count;
    sum += cosine(angle_of(static_cast<double>(s.harmonics[i]) * s.base_hz * m.tau_s + schroeder_turns));
  }
  return s.amplitude * sum;
}

double value_of(const TableShape& s, const Moment& m) noexcept {
  return s.table->at(m.tau_s, s.interpolate);
}

void add_three_phase(const ThreePhaseShape& s, const Moment& m, Connection connection,
                     InputValues& values) noexcept {
  const double rise = m.tau_s < s.rise_s ? m.tau_s / s.rise_s : 1.0;
  const double angle = angle_of(s.frequency_hz * m.tau_s) + s.phase_rad;
  const double lag = connection == Connection::kTwoPhase ? 0.5 * kPi : kTurnRad / 3.0;
  for (int phase = 0; phase < terminal_count(connection); ++phase)
    values[static_cast<std::size_t>(phase)] += rise * s.amplitude * cosine(angle - phase * lag);
}

constexpr std::size_t kPrbsOrders = kMaxPrbsOrder - kMinPrbsOrder + 1;

/// Feedback taps of primitive polynomials, as bit masks of the register; by order from 3 on.
constexpr std::array<std::uint32_t, kPrbsOrders> kTaps = {0x6,    0xC,    0x14,    0x30,    0x60,    0xB8,
                                                          0x110,  0x240,  0x500,   0xE08,   0x1C80,  0x3802,
                                                          0x6000, 0xD008, 0x12000, 0x20400, 0x72000, 0x90000};

std::vector<bool> run_register(std::uint32_t order) {
  const std::uint32_t taps = kTaps[order - kMinPrbsOrder];
  std::vector<bool> bits((std::size_t{1} << order) - 1);
  std::uint32_t state = 1;
  for (std::size_t i = 0; i < bits.size(); ++i) {
    const bool out = (state & 1u) != 0;
    bits[i] = out;
    state >>= 1;
    if (out) state ^= taps;
  }
  return bits;
}

std::array<std::vector<bool>, kPrbsOrders> run_all_registers() {
  std::array<std::vector<bool>, kPrbsOrders> sequences;
  for (std::uint32_t order = kMinPrbsOrder; order <= kMaxPrbsOrder; ++order)
    sequences[order - kMinPrbsOrder] = run_register(order);
  return sequences;
}

}  // namespace

const std::vector<bool>& maximum_length_sequence(std::uint32_t order) {
  static const auto sequences = run_all_registers();
  return sequences[order - kMinPrbsOrder];
}

void add_shape(const InputShape& input, Tick tick, double period_s, Connection connection,
               InputValues& values) noexcept {
  const Tick length = input.end - input.start;
  const auto* const ramp = std::get_if<RampShape>(&input.shape);
  if (ramp == nullptr && (tick < input.start || tick >= input.end)) return;
  const auto channel = static_cast<std::size_t>(input.channel);
  if (ramp != nullptr && (tick <= input.start || tick >= input.end)) {
    values[channel] += tick <= input.start ? ramp->from : ramp->to;
    return;
  }
  const Tick ticks = tick - input.start;
  const Moment moment{.ticks = ticks,
                      .tau_s = static_cast<double>(ticks) * period_s,
                      .length_s = static_cast<double>(length) * period_s};
  std::visit(
      [&](const auto& shape) {
        if constexpr (std::is_same_v<std::decay_t<decltype(shape)>, ThreePhaseShape>) {
          add_three_phase(shape, moment, connection, values);
        } else {
          values[channel] += value_of(shape, moment);
        }
      },
      input.shape);
}

}  // namespace drivebench
