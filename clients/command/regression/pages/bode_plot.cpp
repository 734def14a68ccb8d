#include "clients/command/regression/pages/bode_plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <vector>

#include "clients/regression/checks/frequency_response.hpp"
#include "protocols/markup.hpp"

namespace drivebench::command {
namespace {

using regression::LoopMargins;
using regression::ResponsePoint;

class BodePlot {
 public:
  explicit BodePlot(const std::vector<ResponsePoint>& points)
      : points_(points),
        low_(std::log10(points.front().hz) - 0.03),
        high_(std::log10(points.back().hz) + 0.03) {}

  std::string svg(const std::string& title, bool is_loop) {
    const Half gain = half(&ResponsePoint::gain_db, "gain [dB]", kTop, {5.0, 10.0, 20.0, 50.0, 100.0});
    const Half phase = half(&ResponsePoint::phase_deg, "phase [deg]", kTop + kPanelHeight + kGap,
                            {15.0, 45.0, 90.0, 180.0, 360.0});
    const double height = kTop + 2.0 * kPanelHeight + kGap + kBottom;
    put("<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {0:g} {1:g}' width='{0:g}' height='{1:g}' "
        "font-family='sans-serif' font-size='11'>\n"
        "<style>.g{{stroke:#ddd}}.l{{fill:none;stroke:#0072b2;stroke-width:1.5}}.m{{stroke:#d55e00}}</"
        "style>\n"
        "<text x='{2:g}' y='18' font-size='13'>{3}</text>\n",
        kWidth, height, kLeft, markup(title));
    draw(gain, is_loop ? 0.0 : std::nan(""), false);
    draw(phase, is_loop ? -180.0 : std::nan(""), true);
    if (is_loop) mark_margins(gain, phase);
    put("<text x='{:g}' y='{:g}' text-anchor='middle'>frequency [Hz]</text>\n</svg>\n",
        0.5 * (kLeft + kWidth), height - 8.0);
    return std::move(svg_);
  }

 private:
  static constexpr double kWidth = 720.0;
  static constexpr double kLeft = 64.0;
  static constexpr double kRight = 12.0;
  static constexpr double kTop = 34.0;
  static constexpr double kPanelHeight = 170.0;
  static constexpr double kGap = 14.0;
  static constexpr double kBottom = 40.0;

  /// One of the two panels: its quantity between two multiples of a step.
  struct Half {
    double ResponsePoint::*quantity;
    std::string_view label;
    double top_px;
    double low;
    double high;
    double step;

    double y_px(double value) const { return top_px + kPanelHeight * (high - value) / (high - low); }
  };

  template <class... Values>
  void put(fmt::format_string<Values...> text, Values&&... values) {
    fmt::format_to(std::back_inserter(svg_), text, std::forward<Values>(values)...);
  }

  double x_px(double hz) const {
    return kLeft + (kWidth - kRight - kLeft) * (std::log10(hz) - low_) / (high_ - low_);
  }

  Half half(double ResponsePoint::*quantity, std::string_view label, double top_px,
            std::initializer_list<double> steps) const {
    const auto [least, most] = std::ranges::minmax_element(points_, {}, quantity);
    const double span = *most.*quantity - *least.*quantity;
    double step = *(steps.end() - 1);
    for (const double each : steps) {
      if (span > 6.0 * each) continue;
      step = each;
      break;
    }
    const double low = std::floor(*least.*quantity / step) * step;
    const double high = std::ceil(*most.*quantity / step) * step;
    return {.quantity = quantity,
            .label = label,
            .top_px = top_px,
            .low = low,
            .high = std::max(high, low + step),
            .step = step};
  }

  void draw(const Half& half, double critical, bool is_last) {
    for (double decade = std::floor(low_); decade <= high_; decade += 1.0) {
      for (const double factor : {1.0, 2.0, 5.0}) {
        const double hz = factor * std::pow(10.0, decade);
        if (std::log10(hz) < low_ || std::log10(hz) > high_) continue;
        put("<path class='g' d='M{:.1f} {:.1f}v{:g}'/>\n", x_px(hz), half.top_px, kPanelHeight);
        if (is_last) {
          put("<text x='{:.1f}' y='{:.1f}' text-anchor='middle'>{:.6g}</text>\n", x_px(hz),
              half.top_px + kPanelHeight + 14.0, hz);
        }
      }
    }
    for (double value = half.low; value <= half.high + 0.5 * half.step; value += half.step) {
      put("<path class='{}' d='M{:g} {:.1f}H{:g}'/><text x='{:g}' y='{:.1f}' text-anchor='end'>{:g}</text>\n",
          value == critical ? "m" : "g", kLeft, half.y_px(value), kWidth - kRight, kLeft - 5.0,
          half.y_px(value) + 3.5, value + 0.0);
    }
    put("<text transform='translate(14 {:g}) rotate(-90)' text-anchor='middle'>{}</text>\n",
        half.top_px + 0.5 * kPanelHeight, half.label);
    draw_line(half);
  }

  void draw_line(const Half& half) {
    std::string_view move = "M";
    put("<path class='l' d='");
    for (const ResponsePoint& p : points_) {
      if (p.error > regression::kLargestResponseError) continue;
      put("{}{:.1f} {:.1f}", move, x_px(p.hz), half.y_px(p.*half.quantity));
      move = "L";
    }
    put("'/>\n");
    for (const ResponsePoint& p : points_) {
      put("<circle cx='{:.1f}' cy='{:.1f}' r='2.5' stroke='#0072b2' fill='{}'/>\n", x_px(p.hz),
          half.y_px(p.*half.quantity), p.error > regression::kLargestResponseError ? "#fff" : "#0072b2");
    }
  }

  /// From the critical value to the curve, with the margin beside it.
  void mark(const Half& half, double hz, double critical, double value, const std::string& text) {
    const double from_px = half.y_px(std::clamp(critical, half.low, half.high));
    put("<path class='m' stroke-width='2' d='M{:.1f} {:.1f}V{:.1f}'/>"
        "<text x='{:.1f}' y='{:.1f}' fill='#d55e00'>{}</text>\n",
        x_px(hz), from_px, half.y_px(value), x_px(hz) + 5.0, 0.5 * (from_px + half.y_px(value)) + 4.0, text);
  }

  void mark_margins(const Half& gain, const Half& phase) {
    const LoopMargins m = regression::margins_of(regression::readable(points_));
    if (m.crossover) {
      mark(phase, m.crossover->hz, m.crossover->phase_deg - m.phase_margin_deg, m.crossover->phase_deg,
           fmt::format("{:.1f}\u00b0 at {:.4g} Hz", m.phase_margin_deg, m.crossover->hz));
    }
    if (m.reversal) {
      mark(gain, m.reversal->hz, 0.0, m.reversal->gain_db,
           fmt::format("{:.1f} dB at {:.4g} Hz", m.gain_margin_db, m.reversal->hz));
    }
  }

  const std::vector<ResponsePoint>& points_;
  double low_;  ///< of the logarithm of the frequency
  double high_;
  std::string svg_;
};

}  // namespace

std::string bode_plot(const regression::Finding& finding) {
  const bool is_loop = finding.signal.empty();
  return BodePlot(finding.response)
      .svg(is_loop ? finding.name + ": loop gain" : finding.name + ": " + finding.signal, is_loop);
}

}  // namespace drivebench::command
