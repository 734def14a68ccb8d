#include "plant/sensors/angle_path.hpp"

#include <algorithm>
#include <cstddef>

namespace drivebench {
namespace {

PathPiece part(const PathPiece& whole, double from, double to) noexcept {
  const Hermite curve(whole.start, whole.end, whole.start_slope, whole.end_slope);
  const double width = to - from;
  return {.start_s = whole.start_s + from * whole.duration_s,
          .duration_s = width * whole.duration_s,
          .start = from == 0.0 ? whole.start : curve.value(from),
          .end = to == 1.0 ? whole.end : curve.value(to),
          .start_slope = curve.slope(from) * width,
          .end_slope = curve.slope(to) * width};
}

}  // namespace

PathPieces monotonic_pieces(const PathPiece& whole) noexcept {
  if (whole.is_monotonic()) return {{whole}, 1};
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
  PathPieces result{{}, static_cast<int>(cuts)};
  for (std::size_t i = 0; i < cuts; ++i)
    result.piece[i] = part(whole, cut[i], cut[i + 1]);
  return result;
}

double time_of(const PathPiece& piece, double position) noexcept {
  const Hermite curve(piece.start, piece.end, piece.start_slope, piece.end_slope);
  if (piece.end == piece.start) return piece.start_s;  // a step that only rounding at the wrap has made
  const double sign = piece.end > piece.start ? 1.0 : -1.0;
  double low = 0.0;
  double high = 1.0;
  double s = std::clamp((position - piece.start) / (piece.end - piece.start), 0.0, 1.0);
  for (int i = 0; i < 40; ++i) {  // Newton, kept inside the bracket; two rounds are usual
    const double error = curve.value(s) - position;
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

}  // namespace drivebench
