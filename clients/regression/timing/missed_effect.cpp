#include "clients/regression/timing/missed_effect.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "protocols/markup.hpp"

namespace drivebench::regression {
namespace {

constexpr std::size_t kMostPoints = 500;
constexpr double kEffectWidth = 720.0;
constexpr double kEffectHeight = 190.0;
constexpr double kEffectTop = 24.0;
constexpr double kEffectBottom = 160.0;
constexpr double kEffectMargin = 10.0;

SignalEffect effect_on(const Trace& in_real_time, const Trace& in_time, std::size_t column, std::size_t first,
                       std::size_t end) {
  const Trace::Column& real = in_real_time.columns[column];
  SignalEffect effect{
      .axis = real.axis, .signal = std::string(real.signal->name), .unit = std::string(real.signal->unit)};
  const std::size_t part = (end - first + kMostPoints - 1) / kMostPoints;
  double squares = 0.0;
  double worst_of_part = -1.0;
  for (std::size_t i = first; i < end; ++i) {
    const SignalEffect::Point point{in_real_time.time_s[i], real.values[i],
                                    in_time.columns[column].values[i]};
    const double difference = std::abs(point.in_real_time - point.in_time);
    squares += difference * difference;
    if (difference > effect.worst) {
      effect.worst = difference;
      effect.worst_s = point.time_s;
    }
    if ((i - first) % part == 0) {
      effect.points.push_back(point);
      worst_of_part = difference;
    } else if (difference > worst_of_part) {
      effect.points.back() = point;
      worst_of_part = difference;
    }
  }
  effect.rms = std::sqrt(squares / static_cast<double>(end - first));
  return effect;
}

/// A linear axis of a drawing.
struct LinearAxis {
  double from;
  double to;
  double first_pixel;
  double last_pixel;

  double at(double value) const {
    return first_pixel + (last_pixel - first_pixel) * (value - from) / (to > from ? to - from : 1.0);
  }
};

std::string svg_curve(const SignalEffect& effect, const LinearAxis& x, const LinearAxis& y,
                      double SignalEffect::Point::*value, std::string_view colour) {
  std::string points;
  for (const SignalEffect::Point& point : effect.points)
    points += fmt::format("{:.1f},{:.1f} ", x.at(point.time_s), y.at(point.*value));
  return fmt::format("<polyline points=\"{}\" fill=\"none\" stroke=\"{}\"/>\n", points, colour);
}

std::string svg_text(double x, double y, std::string_view anchor, std::string_view colour,
                     const std::string& text) {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\" fill=\"{}\">{}</text>\n", x, y,
                     anchor, colour, markup(text));
}

}  // namespace

MissedEffect missed_effect(const Trace& in_real_time, const Trace& in_time, double from_s) {
  MissedEffect effect{.from_s = from_s};
  const auto first = static_cast<std::size_t>(std::ranges::lower_bound(in_real_time.time_s, from_s) -
                                              in_real_time.time_s.begin());
  const std::size_t end = std::min(in_real_time.time_s.size(), in_time.time_s.size());
  if (first >= end) {
    effect.problem = "the runs have no common samples";
    return effect;
  }
  for (std::size_t column = 0; column < in_real_time.columns.size(); ++column)
    effect.signals.push_back(effect_on(in_real_time, in_time, column, first, end));
  return effect;
}

std::string svg_effect(const SignalEffect& effect) {
  if (effect.points.size() < 2) return {};
  constexpr std::string_view kReal = "#b3261e";
  constexpr std::string_view kInTime = "#0072b2";
  double low = std::numeric_limits<double>::max();
  double high = std::numeric_limits<double>::lowest();
  for (const SignalEffect::Point& point : effect.points) {
    low = std::min({low, point.in_real_time, point.in_time});
    high = std::max({high, point.in_real_time, point.in_time});
  }
  if (!std::isfinite(low) || !std::isfinite(high)) return {};
  const LinearAxis x{effect.points.front().time_s, effect.points.back().time_s, kEffectMargin,
                     kEffectWidth - kEffectMargin};
  const LinearAxis y{low, high, kEffectBottom, kEffectTop};
  return fmt::format(
             "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\" "
             "font-family=\"sans-serif\" font-size=\"10\">\n",
             kEffectWidth, kEffectHeight) +
         svg_curve(effect, x, y, &SignalEffect::Point::in_time, kInTime) +
         svg_curve(effect, x, y, &SignalEffect::Point::in_real_time, kReal) +
         svg_text(kEffectMargin, 12.0, "start", "#222",
                  fmt::format("{}.{} [{}], {:.4g} to {:.4g}", effect.axis, effect.signal, effect.unit, low,
                              high)) +
         svg_text(kEffectWidth - 150.0, 12.0, "end", kReal, "in real time") +
         svg_text(kEffectWidth - kEffectMargin, 12.0, "end", kInTime, "every answer in time") +
         svg_text(kEffectMargin, kEffectBottom + 14.0, "start", "#222", fmt::format("{:.6g} s", x.from)) +
         svg_text(kEffectWidth - kEffectMargin, kEffectBottom + 14.0, "end", "#222",
                  fmt::format("{:.6g} s", x.to)) +
         svg_text(kEffectWidth / 2.0, kEffectHeight - 4.0, "middle", "#222",
                  fmt::format("difference: rms {:.4g} {}, at most {:.4g} {} at {:.6g} s", effect.rms,
                              effect.unit, effect.worst, effect.unit, effect.worst_s)) +
         "</svg>\n";
}

}  // namespace drivebench::regression
