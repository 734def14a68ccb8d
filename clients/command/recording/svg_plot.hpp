#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace drivebench::command {

/// A line of a panel, with a value for each place on the common axis; it has a gap where a value is not
/// finite.
struct PlotLine {
  std::string name;
  std::vector<double> values;
};

struct Panel {
  std::string label;  ///< of its vertical axis, with unit
  std::vector<PlotLine> lines;
};

/// The label of an axis for a signal: `speed [rad/s]`; a plain number has no unit.
std::string axis_title(std::string_view signal, std::string_view unit);

/// Panels below each other over a common horizontal axis, as an SVG picture of 720 pixels width. Where many
/// values fall into one pixel it draws the smallest and the largest.
std::string svg_of(std::string_view title, std::string_view x_label, const std::vector<double>& x,
                   const std::vector<Panel>& panels);

}  // namespace drivebench::command
