#include "clients/command/recording/svg_plot.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

namespace drivebench::command::svg_plot_test {
namespace {

struct Point {
  long x;
  long y;
};

/// The first line of a picture, in tenths of pixels.
std::vector<Point> line_of(const std::string& svg) {
  const std::size_t start = svg.find(" d='M") + 5;
  std::string text = svg.substr(start, svg.find('\'', start) - start);
  std::ranges::replace(text, 'l', ' ');
  std::istringstream words(text);
  std::vector<Point> points;
  Point at = {0, 0};
  for (Point step = {}; words >> step.x >> step.y;) {
    at = {at.x + step.x, at.y + step.y};
    points.push_back(at);
  }
  return points;
}

// Catches: a picture that thins out its values and loses the one peak that mattered.
TEST(SvgPlot, APeakOfOneSampleAmongManyIsDrawn) {
  std::vector<double> x;
  std::vector<double> y;
  for (int i = 0; i < 100'000; ++i) {
    x.push_back(i);
    y.push_back(i == 77'777 ? 10.0 : i == 20'000 ? -10.0 : 0.0);
  }
  const std::vector<Point> line = line_of(svg_of("", "", x, {{"y", {{"y", y}}}}));
  EXPECT_LT(line.size(), 1000U);
  const auto [top, bottom] = std::ranges::minmax_element(line, {}, &Point::y);
  // The panel is 120 pixels high, and ±10 fill it.
  EXPECT_EQ(bottom->y - top->y, 1200);
  EXPECT_LT(bottom->x, top->x);
  EXPECT_EQ(line.front().x, 640);
  EXPECT_NEAR(static_cast<double>(line.back().x), 7080.0, 20.0);
}

// Catches: a line drawn through values that are not known, or their text in the picture.
TEST(SvgPlot, ALineHasAGapWhereAValueIsNotFinite) {
  const double nothing = std::numeric_limits<double>::quiet_NaN();
  const std::vector<double> x = {0.0, 1.0, 2.0, 3.0, 4.0, 5.0};
  const std::string svg =
      svg_of("gap", "x", x, {{.label = "y", .lines = {{"y", {nothing, 1.0, 2.0, nothing, 2.0, 1.0}}}}});
  const std::size_t start = svg.find(" d='M");
  ASSERT_NE(start, std::string::npos);
  const std::string line = svg.substr(start + 5, svg.find('\'', start + 5) - start - 5);
  EXPECT_EQ(std::ranges::count(line, 'm'), 1) << line;  // one gap inside
  EXPECT_EQ(std::ranges::count(line, 'l'), 2) << line;  // two pieces of two points
  EXPECT_EQ(svg.find("nan"), std::string::npos);
}

// Catches: a title that breaks the picture, and a value range of nothing that divides by zero.
TEST(SvgPlot, TextsAreEscapedAndConstantsHaveARange) {
  const std::string svg = svg_of("a < b & c", "t", {0.0, 1.0}, {{"0 & 1", {{"x", {0.0, 0.0}}}}});
  EXPECT_NE(svg.find("a &lt; b &amp; c"), std::string::npos);
  EXPECT_NE(svg.find("0 &amp; 1"), std::string::npos);
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  EXPECT_EQ(svg.find("inf"), std::string::npos);
}

// Catches: an axis that repeats the unit, one without a name, a plain number with a unit.
TEST(SvgPlot, AnAxisHasTheQuantityAndItsUnit) {
  EXPECT_EQ(axis_title("speed_rad_s", "rad/s"), "speed [rad/s]");
  EXPECT_EQ(axis_title("angle_rad", "rad"), "angle [rad]");
  EXPECT_EQ(axis_title("true_i_a_a", "A"), "true_i_a [A]");
  EXPECT_EQ(axis_title("encoder_count", "counts"), "encoder_count [counts]");
  EXPECT_EQ(axis_title("state", "enum"), "state");
}

}  // namespace
}  // namespace drivebench::command::svg_plot_test
