#include "clients/command/recording/svg_plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <iterator>

#include "protocols/markup.hpp"
#include "protocols/signals/unit_suffix.hpp"

namespace drivebench::command {
namespace {

constexpr double kWidth = 720.0;
constexpr double kLeft = 64.0;
constexpr double kRight = 12.0;
constexpr double kTop = 34.0;
constexpr double kPanelHeight = 120.0;
constexpr double kGap = 14.0;
constexpr double kBottom = 40.0;
constexpr double kLegendRow = 12.0;      // the gap above a panel has room for the first row
constexpr double kPixelsPerPoint = 2.0;  // keeps a file small
// Colours that colour-blind readers distinguish too (Okabe and Ito).
constexpr std::array<std::string_view, 6> kColours = {"#0072b2", "#d55e00", "#009e73",
                                                      "#cc79a7", "#e69f00", "#000000"};

/// The range of an axis of the plot: from a multiple of the step to another.
struct Scale {
  double low = 0.0;
  double high = 1.0;
  double step = 1.0;
  double start_px = 0.0;
  double pixels_per_unit = 1.0;

  double place(double value) const { return start_px + (value - low) * pixels_per_unit; }
};

/// 1, 2 or 5 times a power of ten.
double nice_step(double span, int most_steps) {
  const double least = span / most_steps;
  const double power = std::pow(10.0, std::floor(std::log10(least)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= least * (1.0 - 1e-9)) return factor * power;
  }
  return 10.0 * power;
}

Scale scale_over(double low, double high, int most_steps) {
  if (!(high > low)) {
    const double room = std::max(std::abs(high) * 0.1, 1e-3);
    low -= room;
    high += room;
  }
  const double step = nice_step(high - low, most_steps);
  return {.low = std::floor(low / step + 1e-9) * step,
          .high = std::ceil(high / step - 1e-9) * step,
          .step = step};
}

Scale vertical_scale(const Panel& panel, double top_px) {
  double low = 0.0;
  double high = 0.0;
  for (const PlotLine& line : panel.lines) {
    for (const double value : line.values) {
      if (!std::isfinite(value)) continue;
      low = std::min(low, value);
      high = std::max(high, value);
    }
  }
  Scale scale = scale_over(low, high, 5);
  scale.start_px = top_px + kPanelHeight;
  scale.pixels_per_unit = -kPanelHeight / (scale.high - scale.low);
  return scale;
}

std::string tick_text(double value, double step) {
  return fmt::format("{:.6g}", std::abs(value) < 1e-9 * step ? 0.0 : value);
}

void append_grid(std::string& svg, const Scale& x, const Scale& y, double top_px, bool is_last) {
  const auto out = std::back_inserter(svg);
  for (double value = x.low; value <= x.high + 1e-9 * x.step; value += x.step) {
    const double px = x.place(value);
    if (px < kLeft - 0.5 || px > kWidth - kRight + 0.5) continue;
    fmt::format_to(out, "<line x1='{0:.1f}' y1='{1:.1f}' x2='{0:.1f}' y2='{2:.1f}' class='g'/>\n", px, top_px,
                   top_px + kPanelHeight);
    if (!is_last) continue;
    fmt::format_to(out, "<text x='{:.1f}' y='{:.1f}' text-anchor='middle'>{}</text>\n", px,
                   top_px + kPanelHeight + 14.0, tick_text(value, x.step));
  }
  for (double value = y.low; value <= y.high + 1e-9 * y.step; value += y.step) {
    const double px = y.place(value);
    fmt::format_to(out, "<line x1='{:.1f}' y1='{:.1f}' x2='{:.1f}' y2='{:.1f}' class='g'/>\n", kLeft, px,
                   kWidth - kRight, px);
    fmt::format_to(out, "<text x='{:.1f}' y='{:.1f}' text-anchor='end'>{}</text>\n", kLeft - 5.0, px + 3.5,
                   tick_text(value, y.step));
  }
}

/// Draws the smallest and the largest of the values in a pixel, in their order. Tenths of pixels and steps
/// from point to point keep the text short.
void append_line(std::string& svg, const std::vector<double>& x, const PlotLine& line, const Scale& x_scale,
                 const Scale& y_scale, std::string_view colour) {
  const auto out = std::back_inserter(svg);
  fmt::format_to(out, "<path stroke='{}' d='", colour);
  long last_x = 0;
  long last_y = 0;
  bool is_broken = false;  // by values that are not finite
  const auto point = [&](std::size_t i) {
    const long px = std::lround(10.0 * x_scale.place(x[i]));
    const long py = std::lround(10.0 * y_scale.place(line.values[i]));
    const bool is_first = svg.ends_with('\'');
    fmt::format_to(out, "{}{} {}", is_first ? 'M' : is_broken ? 'm' : 'l', px - last_x, py - last_y);
    last_x = px;
    last_y = py;
    is_broken = false;
  };
  const std::size_t count = std::min(x.size(), line.values.size());
  for (std::size_t begin = 0; begin < count;) {
    const double pixel = std::floor(x_scale.place(x[begin]) / kPixelsPerPoint);
    std::size_t end = begin;
    std::size_t least = count;
    std::size_t largest = count;
    for (; end < count && std::floor(x_scale.place(x[end]) / kPixelsPerPoint) == pixel; ++end) {
      if (!std::isfinite(line.values[end])) continue;
      if (least == count) least = largest = end;
      if (line.values[end] < line.values[least]) least = end;
      if (line.values[end] > line.values[largest]) largest = end;
    }
    begin = end;
    if (least == count) {
      is_broken = true;
      continue;
    }
    point(std::min(least, largest));
    if (least != largest) point(std::max(least, largest));
  }
  svg += "'/>\n";
}

/// Where a name stands in the rows above its panel.
struct LegendPlace {
  double start_px;
  int row;
};

std::vector<LegendPlace> legend_of(const Panel& panel) {
  std::vector<LegendPlace> places;
  LegendPlace next = {.start_px = kLeft + 8.0, .row = 0};
  for (const PlotLine& line : panel.lines) {
    const double width_px = 14.0 + 6.5 * static_cast<double>(line.name.size());
    if (!places.empty() && next.start_px + width_px > kWidth - kRight) {
      next = {.start_px = kLeft + 8.0, .row = next.row + 1};
    }
    places.push_back(next);
    next.start_px += width_px;
  }
  return places;
}

/// Of the rows of its legend beyond the first.
double room_above(const Panel& panel) {
  return panel.lines.empty() ? 0.0 : kLegendRow * legend_of(panel).back().row;
}

void append_panel(std::string& svg, const Panel& panel, const std::vector<double>& x, const Scale& x_scale,
                  double top_px, bool is_last) {
  const auto out = std::back_inserter(svg);
  const Scale y_scale = vertical_scale(panel, top_px);
  append_grid(svg, x_scale, y_scale, top_px, is_last);
  fmt::format_to(
      out, "<text x='12' y='{0:.1f}' text-anchor='middle' transform='rotate(-90 12 {0:.1f})'>{1}</text>\n",
      top_px + kPanelHeight / 2.0, markup(panel.label));
  const std::vector<LegendPlace> legend = legend_of(panel);
  for (std::size_t i = 0; i < panel.lines.size(); ++i) {
    const std::string_view colour = kColours[i % kColours.size()];
    append_line(svg, x, panel.lines[i], x_scale, y_scale, colour);
    if (panel.lines.size() == 1) continue;
    const int rows_below = legend.back().row - legend[i].row;
    fmt::format_to(out, "<text x='{:.1f}' y='{:.1f}' style='fill:{}'>{}</text>\n", legend[i].start_px,
                   top_px - 4.0 - kLegendRow * rows_below, colour, markup(panel.lines[i].name));
  }
}

}  // namespace

std::string axis_title(std::string_view signal, std::string_view unit) {
  if (unit == "1" || unit == "enum" || unit == "bits") return std::string(signal);
  const NameWithUnit parts = split_unit(signal);
  return fmt::format("{} [{}]", parts.unit == unit ? parts.name : signal, unit);
}

std::string svg_of(std::string_view title, std::string_view x_label, const std::vector<double>& x,
                   const std::vector<Panel>& panels) {
  double height = kTop - kGap + kBottom;
  for (const Panel& panel : panels)
    height += room_above(panel) + kPanelHeight + kGap;
  std::string svg = fmt::format(
      "<svg xmlns='http://www.w3.org/2000/svg' width='{0}' height='{1}' viewBox='0 0 {0} {1}' "
      "font-family='sans-serif' font-size='10'>\n"
      "<style>.g{{stroke:#ddd;stroke-width:0.7}} "
      "path{{fill:none;stroke-width:12;transform:scale(.1)}}</style>\n"
      "<rect width='100%' height='100%' fill='#fff'/>\n"
      "<text x='{2}' y='18' font-size='13'>{3}</text>\n",
      kWidth, height, kLeft, markup(title));
  Scale x_scale = scale_over(x.empty() ? 0.0 : x.front(), x.empty() ? 1.0 : x.back(), 10);
  const double shown = x.size() > 1 ? x.back() - x.front() : x_scale.high - x_scale.low;
  x_scale.pixels_per_unit = (kWidth - kLeft - kRight) / shown;
  x_scale.start_px = kLeft + (x_scale.low - (x.empty() ? 0.0 : x.front())) * x_scale.pixels_per_unit;
  double top_px = kTop;
  for (const Panel& panel : panels) {
    top_px += room_above(panel);
    append_panel(svg, panel, x, x_scale, top_px, &panel == &panels.back());
    top_px += kPanelHeight + kGap;
  }
  svg += fmt::format("<text x='{:.1f}' y='{:.1f}' text-anchor='middle'>{}</text>\n</svg>\n",
                     (kLeft + kWidth - kRight) / 2.0, height - 8.0, markup(x_label));
  return svg;
}

}  // namespace drivebench::command
