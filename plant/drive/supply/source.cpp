#include "plant/drive/supply/source.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>

#include "plant/drive/phases.hpp"
#include "plant/math/rounding.hpp"
#include "plant/math/trig.hpp"

namespace drivebench {
namespace {

constexpr std::size_t kMaxCorners = 64;  // of a table; the pieces of a tick have to be recorded

constexpr std::array<CurvePoint, 4> kTrapezoid{
    {{1.0 / 12.0, 1.0}, {5.0 / 12.0, 1.0}, {7.0 / 12.0, -1.0}, {11.0 / 12.0, -1.0}}};

/// The way from this part of a period to the next of the corners, or to the start of a period if `wraps`.
double way_onwards(std::span<const CurvePoint> corners, double part, bool wraps) noexcept {
  const auto next = std::upper_bound(corners.begin(), corners.end(), part,
                                     [](double at, const CurvePoint& p) { return at < p.x; });
  const double corner = next != corners.end() ? next->x : 1.0 + corners.front().x;
  return (wraps ? std::min(corner, 1.0) : corner) - part;
}

double way_back(std::span<const CurvePoint> corners, double part, bool wraps) noexcept {
  const auto passed = std::lower_bound(corners.begin(), corners.end(), part,
                                       [](const CurvePoint& p, double at) { return p.x < at; });
  const double corner = passed != corners.begin() ? (passed - 1)->x : corners.back().x - 1.0;
  return part - (wraps && part > 0.0 ? std::max(corner, 0.0) : corner);
}

}  // namespace

double within_turn(double angle_rad) noexcept {
  const double rest = angle_rad - kTurnRad * static_cast<double>(floor_to_integer(angle_rad / kTurnRad));
  return rest >= 0.0 && rest < kTurnRad ? rest : 0.0;  // rounding may put it on either end
}

double trapezoid(double angle_rad) noexcept {
  constexpr double kQuarter = 0.25 * kTurnRad;
  // Folded at the quarter turns: rising over [-1/4, 1/4] of a turn, falling over [1/4, 3/4].
  const double shifted = within_turn(angle_rad + kQuarter);
  const double folded = shifted <= 2.0 * kQuarter ? shifted - kQuarter : 3.0 * kQuarter - shifted;
  return std::clamp(6.0 / std::numbers::pi * folded, -1.0, 1.0);
}

SourceConstants constants_of(const SourceParameters& p, Connection connection) noexcept {
  const double behind = connection == Connection::kTwoPhase ? kTurnRad / 4.0 : kTurnRad / 3.0;
  const ThreePhase factor{.a = 1.0, .b = p.amplitude_factor_b, .c = p.amplitude_factor_c};
  SourceConstants c{
      .factor = existing(factor, terminal_count(connection)),
      .offset_rad = {.a = 0.0, .b = p.phase_offset_b_rad - behind, .c = p.phase_offset_c_rad - 2.0 * behind},
      .cosine = {},
      .sine = {}};
  c.cosine = by_phase([](double f, double x) { return f * cosine(x); }, c.factor, c.offset_rad);
  c.sine = by_phase([](double f, double x) { return f * sine(x); }, c.factor, c.offset_rad);
  return c;
}

ThreePhase source_voltages(const SourceParameters& p, const SourceConstants& c, double amplitude_v,
                           double angle_rad) noexcept {
  if (p.waveform == Waveform::kSine) {
    const CosSin a = cos_sin(angle_rad);
    return by_phase([=](double cos, double sin) { return amplitude_v * (cos * a.cos - sin * a.sin); },
                    c.cosine, c.sine);
  }
  return by_phase(
      [&](double factor, double offset_rad) {
        const double angle = angle_rad + offset_rad;
        const double value = p.waveform == Waveform::kTrapezoid ? trapezoid(angle)
                                                                : p.table.held(within_turn(angle) / kTurnRad);
        return amplitude_v * factor * value;
      },
      c.factor, c.offset_rad);
}

bool has_corners(const SourceParameters& p, double period_s) noexcept {
  const bool turns = p.frequency_hz != 0.0 && std::abs(p.frequency_hz) * period_s <= 1.0;
  if (p.waveform == Waveform::kTable) return turns && p.table.points().size() <= kMaxCorners;
  return turns && p.waveform == Waveform::kTrapezoid;
}

double time_to_corner_s(const SourceParameters& p, const SourceConstants& c, double angle_rad) noexcept {
  const bool table = p.waveform == Waveform::kTable;
  const std::span<const CurvePoint> corners = table ? std::span(p.table.points()) : std::span(kTrapezoid);
  const auto way = [&](double factor, double offset_rad) {
    if (factor == 0.0) return 2.0;
    const double part = within_turn(angle_rad + offset_rad) / kTurnRad;
    return p.frequency_hz > 0.0 ? way_onwards(corners, part, table) : way_back(corners, part, table);
  };
  const ThreePhase ways = by_phase(way, c.factor, c.offset_rad);
  return std::min({ways.a, ways.b, ways.c}) / std::abs(p.frequency_hz);
}

double time_until_s(double target_rad, double angle_rad, double omega_rad_s) noexcept {
  if (omega_rad_s == 0.0) return std::numeric_limits<double>::infinity();
  constexpr double kReached = 1e-9;  // passed by so little that it is rounding
  const double way_rad = omega_rad_s > 0.0 ? target_rad - angle_rad : angle_rad - target_rad;
  const double left_rad = within_turn(way_rad);
  const double speed_rad_s = omega_rad_s > 0.0 ? omega_rad_s : -omega_rad_s;
  return left_rad > kTurnRad - kReached ? 0.0 : left_rad / speed_rad_s;
}

double capacitor_drop_v(const SourceParameters& p, const StartCapacitor& x, double current_a,
                        double time_s) noexcept {
  // i = i0 + slope t + bend t (t + h), with h the last interval.
  const CurrentTrend& trend = x.current;
  const double charge_as =
      time_s * (current_a +
                time_s * (0.5 * trend.slope_a_s + trend.bend_a_s2 * (time_s / 3.0 + 0.5 * trend.interval_s)));
  return x.voltage_v + charge_as / p.start_capacitance_f +
         p.start_resistance_ohm * foreseen_a(trend, current_a, time_s);
}

StartCapacitor charged(const SourceParameters& p, const StartCapacitor& x, double from_a, double to_a,
                       double duration_s) noexcept {
  const CurrentTrend trend = followed(x.current, from_a, to_a, duration_s);
  // The parabola through both ends and the start of the last interval.
  const double charge_as =
      duration_s * (0.5 * (from_a + to_a) - trend.bend_a_s2 * duration_s * duration_s / 6.0);
  return {.voltage_v = x.voltage_v + charge_as / p.start_capacitance_f, .current = trend};
}

}  // namespace drivebench
