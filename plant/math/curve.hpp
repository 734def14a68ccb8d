#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

namespace drivebench {

struct CurvePoint {
  double x;
  double y;
  friend bool operator==(const CurvePoint&, const CurvePoint&) = default;
};

/// A piecewise linear function given by its points, x strictly rising. Copies share the points; a curve never
/// changes. An empty curve is zero everywhere.
class Curve {
 public:
  Curve() = default;
  /// The points must be free of problem_with_points().
  explicit Curve(std::vector<CurvePoint> points);

  bool empty() const noexcept { return table_ == nullptr; }
  const std::vector<CurvePoint>& points() const noexcept;

  /// y at x; beyond the ends the value of the end.
  double held(double x) const noexcept;
  /// y at x; beyond the ends the line goes on.
  double value(double x) const noexcept;
  /// dy/dx at x; at a point that of the segment to its right.
  double slope(double x) const noexcept;
  /// x at which the curve plus added_slope x is y, for curves that rise everywhere; beyond the ends the line
  /// goes on.
  double inverse(double y, double added_slope = 0.0) const noexcept;
  /// Integral of y from the first point to x.
  double area(double x) const noexcept;

 private:
  struct Table {
    std::vector<CurvePoint> points;
    std::vector<double> slope;  ///< from each point on; the last segment goes on for ever
    std::vector<double> area;   ///< up to each point
  };
  std::size_t segment_of_x(double x) const noexcept;

  std::shared_ptr<const Table> table_;
};

/// The problem of the points of a curve (fewer than two, not finite, x not rising) with the first bad one;
/// empty: none. `rising`: y must rise as well.
std::string problem_with_points(const std::vector<CurvePoint>& points, bool rising);

}  // namespace drivebench
