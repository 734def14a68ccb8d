#include "plant/drive/inverter.hpp"

#include <algorithm>
#include <bit>

#include "plant/drive/phases.hpp"

namespace drivebench {
namespace {

/// An instant that carries the number of its terminal in the last two bits of the mantissa: less than 1e-15
/// of its value, and the two are sorted as one.
double marked(double instant_s, std::uint64_t terminal) noexcept {
  return std::bit_cast<double>((std::bit_cast<std::uint64_t>(instant_s) & ~std::uint64_t{3}) | terminal);
}

std::uint64_t terminal_of(double marked_s) noexcept {
  return std::bit_cast<std::uint64_t>(marked_s) & 3U;
}

/// A sorting network for six: no branch that depends on the voltages.
void sort_six(std::array<double, 6>& x) noexcept {
  const auto in_order = [&x](std::size_t i, std::size_t j) {
    const double low = std::min(x[i], x[j]);
    x[j] = std::max(x[i], x[j]);
    x[i] = low;
  };
  in_order(1, 2), in_order(4, 5);
  in_order(0, 2), in_order(3, 5);
  in_order(0, 1), in_order(3, 4), in_order(2, 5);
  in_order(0, 3), in_order(1, 4);
  in_order(2, 4), in_order(1, 3);
  in_order(2, 3);
}

}  // namespace

LimitedVoltages bridge_voltages(Connection connection, double bus_v, const ThreePhase& wanted_v) noexcept {
  if (connection != Connection::kStar) return clipped(wanted_v, bus_v);
  const double low_v = std::min({wanted_v.a, wanted_v.b, wanted_v.c});
  const double high_v = std::max({wanted_v.a, wanted_v.b, wanted_v.c});
  const bool saturated = high_v - low_v > bus_v;
  const double scale = saturated ? bus_v / (high_v - low_v) : 1.0;
  const double shift_v = 0.5 * (low_v + high_v);
  return {.voltage_v = by_phase([=](double x) { return scale * (x - shift_v); }, wanted_v),
          .saturated = saturated};
}

double averaged_voltage_v(double voltage_v, double rail_v, double dead_part, double current_a,
                          double band_a) noexcept {
  if (dead_part == 0.0) return voltage_v;
  const double switching_v = rail_v * (1.0 - 2.0 * std::min(dead_part, 0.5));
  if (voltage_v <= -switching_v) return -rail_v;
  if (voltage_v >= switching_v) return rail_v;
  const double direction = std::clamp(current_a / band_a, -1.0, 1.0);
  return voltage_v - direction * 2.0 * rail_v * dead_part;
}

SwitchingPattern::SwitchingPattern(const ThreePhase& voltage_v, int terminals, double rail_v,
                                   double dead_time_s, double period_s, std::uint32_t legs_off) noexcept {
  const std::array<double, 3> wanted_v{voltage_v.a, voltage_v.b, voltage_v.c};
  std::array<double, 6> first_half;
  first_half.fill(kNever);
  std::size_t count = 0;
  std::uint64_t passed = 0;
  for (std::size_t k = 0; k < static_cast<std::size_t>(terminals); ++k) {
    if ((legs_off >> k & 1U) != 0) {
      passed += kOff << (kBits * k);
      continue;
    }
    const double on = duty(wanted_v[k], rail_v, dead_time_s / period_s);
    if (on == 1.0) passed += kHigh << (kBits * k);
    if (on == 0.0 || on == 1.0) continue;
    const double rise_s = 0.5 * (1.0 - on) * period_s;
    first_half[count++] = marked(rise_s - 0.5 * dead_time_s, k);
    first_half[count++] = marked(rise_s + 0.5 * dead_time_s, k);
  }
  sort_six(first_half);
  std::size_t segment = 0;
  const auto end_segment = [&](double until_s, double marked_s) {
    segments_[segment++] = {.until_s = until_s, .passed = passed};
    passed += std::uint64_t{1} << (kBits * terminal_of(marked_s));
  };
  for (std::size_t n = 0; n < count; ++n)
    end_segment(first_half[n], first_half[n]);
  for (std::size_t n = count; n-- > 0;)
    end_segment(period_s - first_half[n], first_half[n]);
  segments_[segment] = {.until_s = kNever, .passed = passed};
}

}  // namespace drivebench
