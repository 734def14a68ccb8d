#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace drivebench::command {

/// One line of a panel; as many values as there are places on the common axis.
struct Series {
  std::string name;
  std::vector<double> values;
};

struct Panel {
  std::string label;  ///< of its vertical axis, with unit
  std::vector<Series> series;
};

/// Panels below each other over a common horizontal axis, as an SVG picture of 720 pixels width. Of many
/// values in one pixel the smallest and the largest are drawn.
std::string svg_of(std::string_view title, std::string_view x_label, const std::vector<double>& x,
                   const std::vector<Panel>& panels);

}  // namespace drivebench::command
