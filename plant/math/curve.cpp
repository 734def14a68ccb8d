#include "plant/math/curve.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace drivebench {

Curve::Curve(std::vector<CurvePoint> points) {
  Table table;
  table.slope.reserve(points.size());
  table.area.reserve(points.size());
  double area = 0.0;
  for (std::size_t k = 0; k + 1 < points.size(); ++k) {
    const auto& [x0, y0] = points[k];
    const auto& [x1, y1] = points[k + 1];
    table.area.push_back(area);
    table.slope.push_back((y1 - y0) / (x1 - x0));
    area += (x1 - x0) * (0.5 * (y0 + y1));
  }
  table.points = std::move(points);
  table_ = std::make_shared<const Table>(std::move(table));
}

const std::vector<CurvePoint>& Curve::points() const noexcept {
  static const std::vector<CurvePoint> kNone;
  return table_ ? table_->points : kNone;
}

std::size_t Curve::segment_of_x(double x) const noexcept {
  const std::vector<CurvePoint>& points = table_->points;
  const auto inner = points.begin() + 1;
  const auto after =
      std::upper_bound(inner, points.end() - 1, x, [](double at, const CurvePoint& p) { return at < p.x; });
  return static_cast<std::size_t>(after - inner);
}

double Curve::held(double x) const noexcept {
  if (empty()) return 0.0;
  if (x <= table_->points.front().x) return table_->points.front().y;
  if (x >= table_->points.back().x) return table_->points.back().y;
  return value(x);
}

double Curve::value(double x) const noexcept {
  if (empty()) return 0.0;
  const std::size_t k = segment_of_x(x);
  const CurvePoint& p = table_->points[k];
  return p.y + (x - p.x) * table_->slope[k];
}

double Curve::slope(double x) const noexcept {
  return empty() ? 0.0 : table_->slope[segment_of_x(x)];
}

double Curve::inverse(double y, double added_slope) const noexcept {
  if (empty()) return 0.0;
  const std::vector<CurvePoint>& points = table_->points;
  const auto inner = points.begin() + 1;
  const auto after = std::upper_bound(
      inner, points.end() - 1, y,
      [added_slope](double at, const CurvePoint& p) { return at < p.y + added_slope * p.x; });
  const auto k = static_cast<std::size_t>(after - inner);
  const CurvePoint& p = points[k];
  return p.x + (y - (p.y + added_slope * p.x)) / (table_->slope[k] + added_slope);
}

double Curve::area(double x) const noexcept {
  if (empty()) return 0.0;
  const std::size_t k = segment_of_x(x);
  const CurvePoint& p = table_->points[k];
  const double dx = x - p.x;
  return table_->area[k] + dx * (p.y + 0.5 * table_->slope[k] * dx);
}

std::string problem_with_points(const std::vector<CurvePoint>& points, bool rising) {
  if (points.size() < 2) {
    return "has " + std::to_string(points.size()) + (points.size() == 1 ? " point" : " points") +
           " but must have at least 2";
  }
  for (std::size_t k = 0; k < points.size(); ++k) {
    const auto because = [k](const char* rule) { return "point " + std::to_string(k + 1) + " " + rule; };
    if (!std::isfinite(points[k].x) || !std::isfinite(points[k].y)) return because("must be finite");
    if (k == 0) continue;
    if (!(points[k].x > points[k - 1].x)) return because("must have a larger x than the one before");
    if (rising && !(points[k].y > points[k - 1].y))
      return because("must have a larger y than the one before");
    const double slope = (points[k].y - points[k - 1].y) / (points[k].x - points[k - 1].x);
    if (!std::isfinite(slope) || (rising && !(slope > 0.0)))
      return because("must not be so near to the one before, or so far, that the slope between them is lost");
  }
  return {};
}

}  // namespace drivebench
