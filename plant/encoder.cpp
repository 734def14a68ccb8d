#include "plant/encoder.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace drivebench {
namespace {

/// The cubic on s in [0, 1] with the given end values and end slopes.
struct Hermite {
  double constant, linear, quadratic, cubic;

  Hermite(double start, double end, double start_slope, double end_slope) noexcept
      : constant(start),
        linear(start_slope),
        quadratic(3.0 * (end - start) - 2.0 * start_slope - end_slope),
        cubic(2.0 * (start - end) + start_slope + end_slope) {}

  double value(double s) const noexcept { return constant + s * (linear + s * (quadratic + s * cubic)); }
  double slope(double s) const noexcept { return linear + s * (2.0 * quadratic + s * 3.0 * cubic); }
};

/// floor(count / divisor) for a positive divisor.
std::int64_t floor_divide(std::int64_t count, std::int64_t divisor) noexcept {
  const std::int64_t quotient = count / divisor;
  return quotient - (count % divisor < 0 ? 1 : 0);
}

/// Fritsch and Carlson: end slopes between 0 and 3 times the mean slope make the cubic monotonic.
bool is_monotonic(double rise, double start_slope, double end_slope) noexcept {
  const double limit = 3.0 * std::abs(rise);
  return start_slope * rise >= 0.0 && end_slope * rise >= 0.0 && std::abs(start_slope) <= limit &&
         std::abs(end_slope) <= limit;
}

}  // namespace

Encoder::Encoder(const EncoderParameters& p, double period_s) noexcept
    : p_(p),
      period_s_(period_s),
      counts_per_rad_(p.counts_per_revolution / (2.0 * std::numbers::pi)),
      offset_(p.half_count_offset ? 0.5 : 0.0) {}

double Encoder::position(double angle_rad) const noexcept {
  return angle_rad * counts_per_rad_ + offset_;
}

std::int64_t Encoder::count_at(double angle_rad, std::int64_t turn) const noexcept {
  return turn * p_.counts_per_revolution + floor_to_integer(position(angle_rad));
}

Encoder::Piece Encoder::part(const Piece& whole, double from, double to) noexcept {
  const Hermite curve(whole.start, whole.end, whole.start_slope, whole.end_slope);
  const double width = to - from;
  return {.start_s = whole.start_s + from * whole.duration_s,
          .duration_s = width * whole.duration_s,
          .start = from == 0.0 ? whole.start : curve.value(from),
          .end = to == 1.0 ? whole.end : curve.value(to),
          .start_slope = curve.slope(from) * width,
          .end_slope = curve.slope(to) * width};
}

bool Encoder::has_no_edge(const AngleSegment& segment) const noexcept {
  const double start = position(segment.start_rad);
  const double end = position(segment.end_rad);
  const double slope_scale = counts_per_rad_ * segment.duration_s;
  return floor_to_integer(start) == floor_to_integer(end) &&
         is_monotonic(end - start, segment.start_rad_s * slope_scale, segment.end_rad_s * slope_scale);
}

Encoder::Pieces Encoder::monotonic_pieces(const AngleSegment& segment) const noexcept {
  const double slope_scale = counts_per_rad_ * segment.duration_s;
  const Piece whole{.start_s = segment.start_s,
                    .duration_s = segment.duration_s,
                    .start = position(segment.start_rad),
                    .end = position(segment.end_rad),
                    .start_slope = segment.start_rad_s * slope_scale,
                    .end_slope = segment.end_rad_s * slope_scale};
  if (is_monotonic(whole.end - whole.start, whole.start_slope, whole.end_slope)) return {{whole}, 1};

  const Hermite curve(whole.start, whole.end, whole.start_slope, whole.end_slope);
  const double a = 3.0 * curve.cubic;
  const double b = curve.quadratic;  // half of the linear coefficient of the slope
  const double c = curve.linear;
  const double discriminant = b * b - a * c;
  std::array<double, 4> cut{0.0};
  std::size_t cuts = 1;
  if (discriminant > 0.0) {
    const double q = -(b + std::copysign(std::sqrt(discriminant), b));
    const std::array<double, 2> root{a != 0.0 ? q / a : -1.0, q != 0.0 ? c / q : -1.0};
    for (const double s : {std::min(root[0], root[1]), std::max(root[0], root[1])}) {
      if (s > cut[cuts - 1] && s < 1.0) cut[cuts++] = s;
    }
  }
  cut[cuts] = 1.0;
  Pieces result{{}, static_cast<int>(cuts)};
  for (std::size_t i = 0; i < cuts; ++i)
    result.piece[i] = part(whole, cut[i], cut[i + 1]);
  return result;
}

double Encoder::time_of(const Piece& piece, double boundary) noexcept {
  const Hermite curve(piece.start, piece.end, piece.start_slope, piece.end_slope);
  if (piece.end == piece.start) return piece.start_s;  // a count that only rounding at the wrap has changed
  const double sign = piece.end > piece.start ? 1.0 : -1.0;
  double low = 0.0;
  double high = 1.0;
  double s = std::clamp((boundary - piece.start) / (piece.end - piece.start), 0.0, 1.0);
  for (int i = 0; i < 40; ++i) {  // Newton, kept inside the bracket; two rounds are usual
    const double error = curve.value(s) - boundary;
    if (error * sign > 0.0) {
      high = s;
    } else {
      low = s;
    }
    if (error == 0.0) break;
    const double slope = curve.slope(s);
    double next = slope != 0.0 ? s - error / slope : low;
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    const double change = std::abs(next - s);
    s = next;
    if (change < 1e-7) break;  // the error is of the order of its square
  }
  return piece.start_s + s * piece.duration_s;
}

void Encoder::follow(EncoderState& state, std::span<const AngleSegment> segments, Tick tick,
                     std::int64_t turn) const noexcept {
  const std::int64_t base = turn * p_.counts_per_revolution;
  std::array<Edge, 2> last{};  // newest first
  std::size_t found = 0;
  bool index_found = false;
  for (std::size_t n = segments.size(); n-- > 0;) {
    const bool starts_at_count = n > 0 || count_at(segments[0].start_rad, turn) == state.count;
    if (starts_at_count && has_no_edge(segments[n])) continue;
    const Pieces pieces = monotonic_pieces(segments[n]);
    for (int i = pieces.size; i-- > 0;) {
      const Piece& piece = pieces.piece[static_cast<std::size_t>(i)];
      // The tick starts with the count that the last one ended with: where the angle wraps in between,
      // rounding can put it on the other side of a boundary.
      const std::int64_t first = n == 0 && i == 0 ? state.count - base : floor_to_integer(piece.start);
      const std::int64_t end = floor_to_integer(piece.end);
      if (first == end) continue;
      const int direction = end > first ? 1 : -1;
      for (std::int64_t count = end; count != first && found < last.size(); count -= direction) {
        const double boundary = static_cast<double>(direction > 0 ? count : count + 1);
        last[found++] = {.time_s = time_of(piece, boundary), .count = base + count, .direction = direction};
      }
      // The index line rises where the count becomes a multiple of N: from below, or from the count above it.
      const std::int64_t shift = direction > 0 ? 0 : -1;
      const std::int64_t turns_before = floor_divide(first + shift, p_.counts_per_revolution);
      const std::int64_t turns_after = floor_divide(end + shift, p_.counts_per_revolution);
      if (!index_found && turns_before != turns_after) {
        index_found = true;
        state.index_tick = tick;
        state.index_count = base + (direction > 0 ? turns_after : turns_after + 1) * p_.counts_per_revolution;
      }
    }
  }
  if (found > 0) {
    const double before_s =  // the edge before the newest one, from the start of this tick
        found == 2 ? last[1].time_s
                   : static_cast<double>(state.last_edge_tick - tick) * period_s_ + state.last_edge_s;
    const std::int64_t direction_before = found == 2 ? last[1].direction : state.direction;
    const bool has_before = found == 2 || state.edges_seen > 0;
    state.period_s = has_before ? last[0].time_s - before_s : 0.0;
    state.edges_seen = has_before ? 2 : 1;
    state.direction_changed = has_before && direction_before != last[0].direction ? 1 : 0;
    state.direction = last[0].direction;
    state.last_edge_tick = tick;
    state.last_edge_s = last[0].time_s;
  }
  if (!segments.empty()) state.count = base + floor_to_integer(position(segments.back().end_rad));
}

std::uint32_t Encoder::levels(const EncoderState& state) const noexcept {
  const std::int64_t phase = state.count & 3;  // 0: A=0 B=0, 1: A=1 B=0, 2: A=1 B=1, 3: A=0 B=1
  std::uint32_t levels = 0;
  if (phase == 1 || phase == 2) levels |= kLevelA;
  if (phase == 2 || phase == 3) levels |= kLevelB;
  if (state.count % p_.counts_per_revolution == 0) levels |= kLevelZ;
  if (state.direction < 0) levels |= kReverse;
  if (state.direction_changed != 0) levels |= kDirectionChanged;
  if (state.edges_seen == 2) levels |= kPeriodValid;
  return levels;
}

double Encoder::edge_age_s(const EncoderState& state, Tick tick) const noexcept {
  return static_cast<double>(tick - state.last_edge_tick) * period_s_ - state.last_edge_s;
}

}  // namespace drivebench
