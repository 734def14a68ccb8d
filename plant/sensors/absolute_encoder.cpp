#include "plant/sensors/absolute_encoder.hpp"

#include <algorithm>
#include <numbers>

#include "plant/math/rounding.hpp"

namespace drivebench {

AbsoluteEncoder::AbsoluteEncoder(const AbsoluteEncoderParameters& p, double period_s) noexcept : p_(p) {
  // A latency of whole ticks may be short of them by rounding.
  late_ticks_ = floor_to_integer(p.latency_s / period_s + 1e-9);
  instant_s_ = period_s - std::max(0.0, p.latency_s - static_cast<double>(late_ticks_) * period_s);
}

std::uint64_t AbsoluteEncoder::number_at(double angle_rad) const noexcept {
  const std::uint64_t steps = std::uint64_t{1} << p_.bits;
  const double turns = (angle_rad + p_.offset_rad) / (2.0 * std::numbers::pi);
  return static_cast<std::uint64_t>(floor_to_integer(turns * static_cast<double>(steps))) & (steps - 1);
}

AbsoluteMemory AbsoluteEncoder::settled(double angle_rad) const noexcept {
  AbsoluteMemory m;
  if (!enabled()) return m;
  m.latched = number_at(angle_rad);
  m.history.fill(m.latched);
  return m;
}

void AbsoluteEncoder::follow(AbsoluteMemory& m, std::span<const AngleSegment> segments) const noexcept {
  for (std::size_t n = segments.size(); n-- > 0;) {
    const AngleSegment& segment = segments[n];
    if (!(segment.start_s < instant_s_)) continue;
    const PathPiece angle = path_piece(segment, 1.0, 0.0);
    const double part = (instant_s_ - segment.start_s) / segment.duration_s;
    const Hermite curve(angle.start, angle.end, angle.start_slope, angle.end_slope);
    m.latched = number_at(part < 1.0 ? curve.value(part) : angle.end);
    return;
  }
}

}  // namespace drivebench
