#include "server/bench/multisine.hpp"

#include <cmath>
#include <numbers>

#include "plant/math/trig.hpp"

namespace drivebench {
namespace {

MultisineLines lines_in(const RunningMultisine& m) noexcept {
  return {.period_ticks = static_cast<std::uint32_t>(m.period_ticks),
          .lowest = static_cast<std::uint32_t>(m.lowest),
          .highest = static_cast<std::uint32_t>(m.highest),
          .ratio = m.ratio};
}

}  // namespace

RunningMultisine begun(const Multisine& multisine, Tick start, double base) noexcept {
  return {.quantity = static_cast<std::uint64_t>(multisine.quantity),
          .periods = multisine.periods,
          .amplitude = multisine.amplitude,
          .period_ticks = multisine.lines.period_ticks,
          .lowest = multisine.lines.lowest,
          .highest = multisine.lines.highest,
          .ratio = multisine.lines.ratio,
          .start = start,
          .base = base};
}

double value_at(const RunningMultisine& m, Tick tick) noexcept {
  const LineList lines = lines_of(lines_in(m));
  const std::uint64_t k = static_cast<std::uint64_t>(tick - m.start) % m.period_ticks;
  double sum = 0.0;
  for (std::uint64_t j = 0; j < lines.count; ++j) {
    const auto turn =
        static_cast<double>(lines.multiple[j] * k % m.period_ticks) / static_cast<double>(m.period_ticks);
    sum += sine(2.0 * std::numbers::pi * (turn - line_phase(j)));
  }
  return m.base + m.amplitude * sum;
}

bool is_possible(const Multisine& m) noexcept {
  return m.quantity <= Multisine::Quantity::kCurrentOffset && m.periods >= 1 &&
         m.periods <= kMostMultisinePeriods && std::abs(m.amplitude) <= kMaxMultisineAmplitude &&
         are_possible(m.lines);
}

bool is_possible(const RunningMultisine& m) noexcept {
  if (!m.is_running()) return true;
  constexpr std::uint64_t kWord = std::uint64_t{1} << 32;
  if (m.quantity >= kWord || m.periods >= kWord || m.period_ticks >= kWord || m.lowest >= kWord ||
      m.highest >= kWord) {
    return false;
  }
  return is_possible(Multisine{.quantity = static_cast<Multisine::Quantity>(m.quantity),
                               .periods = static_cast<std::uint32_t>(m.periods),
                               .amplitude = m.amplitude,
                               .lines = lines_in(m)}) &&
         m.start >= 0 && m.start <= static_cast<Tick>(kMaxTick) && std::isfinite(m.base);
}

}  // namespace drivebench
