#pragma once

#include <array>
#include <cmath>

namespace drivebench {

/// The shaft between two integration nodes: its angle and speed at both ends. Between them the angle is the
/// cubic with these end values and slopes, which is exact at constant acceleration.
struct AngleSegment {
  double start_s;  ///< from the start of the tick
  double duration_s;
  double start_rad;  ///< angle within the turn in which the tick started
  double end_rad;
  double start_rad_s;
  double end_rad_s;
};

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

/// A segment in the steps of a sensor: counts of an encoder, sectors of Hall lines.
struct PathPiece {
  double start_s;
  double duration_s;
  double start;  ///< position [steps] within the turn
  double end;
  double start_slope;  ///< change of position over the piece if the speed stayed [steps]
  double end_slope;

  /// Fritsch and Carlson: end slopes between 0 and 3 times the mean slope make the cubic monotonic.
  bool is_monotonic() const noexcept {
    const double rise = end - start;
    const double limit = 3.0 * std::abs(rise);
    return start_slope * rise >= 0.0 && end_slope * rise >= 0.0 && std::abs(start_slope) <= limit &&
           std::abs(end_slope) <= limit;
  }
};

/// The position is angle times steps_per_rad plus offset.
inline PathPiece path_piece(const AngleSegment& segment, double steps_per_rad, double offset) noexcept {
  const double slope_scale = steps_per_rad * segment.duration_s;
  return {.start_s = segment.start_s,
          .duration_s = segment.duration_s,
          .start = segment.start_rad * steps_per_rad + offset,
          .end = segment.end_rad * steps_per_rad + offset,
          .start_slope = segment.start_rad_s * slope_scale,
          .end_slope = segment.end_rad_s * slope_scale};
}

/// A piece cut where the shaft reverses, so that the position is monotonic in each part.
struct PathPieces {
  std::array<PathPiece, 3> piece;
  int size;
};
PathPieces monotonic_pieces(const PathPiece& whole) noexcept;

/// When a monotonic piece passes a position, from the start of the tick.
double time_of(const PathPiece& piece, double position) noexcept;

}  // namespace drivebench
