#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "clients/regression/timing/log_bins.hpp"
#include "clients/regression/timing/timing_report.hpp"
#include "protocols/markup.hpp"

namespace drivebench::regression {
namespace {

constexpr std::string_view kTimingStyle =
    "body{font:14px/1.4 sans-serif;margin:2em auto;max-width:72em;color:#222}"
    "table{border-collapse:collapse;width:100%}td,th{padding:.25em .6em;border-bottom:1px solid #ddd;"
    "text-align:right;vertical-align:top;font-variant-numeric:tabular-nums}"
    "td:first-child,th:first-child{text-align:left}svg{max-width:100%;height:auto}";

constexpr std::string_view kTimingHead =
    "<th>way<th>answers<th>p50 [us]<th>p99 [us]<th>worst [us]<th>jitter rms [us]<th>jitter peak [us]"
    "<th>phase p50 [us]<th>phase p99 [us]<th>late<th>missed<th>in a row</tr>\n";

constexpr std::string_view kTimingWords =
    "<p>An answer lasts from the departure of a sample to the arrival of the command for it: in process the "
    "computing time of the controller; in lockstep that of the program and its link, both ways; in real time "
    "the same while time goes on. Jitter is the deviation from p50. The phase of an answer is its arrival "
    "after the start of its tick; one that comes after the end of that tick is late. A tick without a "
    "command "
    "is missed. The bars are as high as the logarithms of their counts. These are times of the machine that "
    "ran the suite.</p>\n";

constexpr double kWidth = 720.0;
constexpr double kHeight = 170.0;
constexpr double kBottom = 140.0;
constexpr double kTop = 24.0;
constexpr double kMarkText = 20.0;
constexpr double kEndText = 9.0;

std::string us_text(double ns) {
  return fmt::format("{:.4g}", ns * 1e-3);
}

std::string number_cells(const DeviceTiming& timing) {
  const TimeHistogram& times = timing.answers.after_sample;
  const TimeHistogram& phase = timing.answers.after_tick;
  const bool is_realtime = timing.way == DeviceTiming::Way::kRealtime;
  const std::string realtime =
      is_realtime ? fmt::format("<td>{}<td>{}<td>{}<td>{}<td>{}", us_text(phase.percentile_ns(0.5)),
                                us_text(phase.percentile_ns(0.99)), timing.answers.late, timing.missed.all,
                                timing.missed.longest_burst)
                  : "<td>-<td>-<td>-<td>-<td>-";
  return fmt::format("<td>{}<td>{}<td>{}<td>{}<td>{}<td>{}<td>{}{}</tr>\n", word_of(timing.way),
                     times.count(), us_text(times.percentile_ns(0.5)), us_text(times.percentile_ns(0.99)),
                     us_text(static_cast<double>(times.worst_ns())), us_text(times.jitter_rms_ns()),
                     us_text(times.jitter_peak_ns()), realtime);
}

/// The horizontal axis of a drawing: logarithmic time.
struct LogAxis {
  double from_ns;
  double to_ns;

  double x(double ns) const {
    return 10.0 + (kWidth - 20.0) * std::log(ns / from_ns) / std::log(to_ns / from_ns);
  }
};

std::string svg_mark(const LogAxis& axis, double ns, double text_y, std::string_view name) {
  const double x = axis.x(ns);
  return fmt::format(
      "<line x1=\"{0:.1f}\" x2=\"{0:.1f}\" y1=\"{1}\" y2=\"{2}\" stroke=\"#b3261e\"/>"
      "<text x=\"{0:.1f}\" y=\"{3}\" text-anchor=\"middle\">{4}</text>\n",
      x, kTop, kBottom, text_y, name);
}

/// Marks on the axis at 1, 2 and 5 times the powers of ten.
std::string svg_scale(const LogAxis& axis) {
  std::string svg;
  for (double decade_ns = 1.0; decade_ns <= axis.to_ns; decade_ns *= 10.0) {
    for (const double digit : {1.0, 2.0, 5.0}) {
      const double ns = digit * decade_ns;
      if (ns < axis.from_ns || ns > axis.to_ns) continue;
      svg += fmt::format("<text x=\"{:.1f}\" y=\"{}\" text-anchor=\"middle\">{:g}</text>\n", axis.x(ns),
                         kBottom + 14.0, ns * 1e-3);
    }
  }
  return svg;
}

/// The histogram as bars over logarithmic time; their heights are logarithms of the counts, so that a single
/// answer is seen beside a million. `end_ns` is the end of the tick; 0: none.
std::string svg_histogram(std::string_view title, const TimeHistogram& times, double end_ns) {
  const std::vector<LogBin> bins = log_bins(times);
  if (bins.empty()) return {};
  const double first_ns = std::max(1.0, static_cast<double>(bins.front().from_ns));
  const double last_ns = std::max(2.0 * first_ns, static_cast<double>(bins.back().to_ns));
  const LogAxis axis{.from_ns = first_ns, .to_ns = std::max(last_ns, 1.1 * end_ns)};
  const auto height = [](std::uint64_t count) { return std::log1p(static_cast<double>(count)); };
  const double most = height(std::ranges::max_element(bins, {}, &LogBin::count)->count);
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\" "
      "font-family=\"sans-serif\" font-size=\"10\">\n",
      kWidth, kHeight);
  for (const LogBin& bin : bins) {
    if (bin.count == 0) continue;
    const double left = axis.x(std::max(first_ns, static_cast<double>(bin.from_ns)));
    const double tall = (kBottom - kTop) * height(bin.count) / most;
    svg += fmt::format(
        "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"#0072b2\">"
        "<title>{} to {} us: {}</title></rect>\n",
        left, kBottom - tall, std::max(1.0, axis.x(static_cast<double>(bin.to_ns)) - left - 0.5), tall,
        us_text(static_cast<double>(bin.from_ns)), us_text(static_cast<double>(bin.to_ns)), bin.count);
  }
  svg += svg_mark(axis, std::max(first_ns, times.percentile_ns(0.5)), kMarkText, "p50");
  svg += svg_mark(axis, std::max(first_ns, times.percentile_ns(0.99)), kMarkText, "p99");
  if (end_ns > first_ns) svg += svg_mark(axis, end_ns, kEndText, "end of the tick");
  return svg + svg_scale(axis) +
         fmt::format("<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{} [us]</text>\n</svg>\n", kWidth / 2.0,
                     kHeight - 4.0, markup(title));
}

std::string svg_timing(const DeviceTiming& timing) {
  return svg_histogram("from sample to command", timing.answers.after_sample, 0.0) +
         svg_histogram("phase: arrival after the start of the tick", timing.answers.after_tick,
                       static_cast<double>(timing.period_ns));
}

std::string effect_text(const DeviceTiming& timing) {
  if (!timing.effect) return {};
  const MissedEffect& effect = *timing.effect;
  if (!effect.problem.empty())
    return fmt::format("<p>What late and missed answers changed is not known: {}.</p>\n",
                       markup(effect.problem));
  std::string text = fmt::format(
      "<p>What late and missed answers changed: the run, and beside it the same one in lockstep from {:.6g} "
      "s on, where every "
      "answer came in time.</p>\n",
      effect.from_s);
  for (const SignalEffect& each : effect.signals)
    text += svg_effect(each);
  return text;
}

std::string group_name(const TimingGroup& group) {
  const bool is_realtime = group.all.way == DeviceTiming::Way::kRealtime;
  return fmt::format("{} case{}{}", group.cases, group.cases == 1 ? "" : "s",
                     is_realtime
                         ? fmt::format(", ticks of {} us", us_text(static_cast<double>(group.all.period_ns)))
                         : std::string());
}

}  // namespace

std::string timing_case_row(std::string_view name, const DeviceTiming& timing, bool draws) {
  const std::string drawing = draws ? svg_timing(timing) + effect_text(timing) : std::string();
  std::string rows = fmt::format("<tr><td>{}{}", markup(name), number_cells(timing));
  // A row of its own, as wide as the table.
  if (!drawing.empty()) {
    rows +=
        fmt::format("<tr><td colspan=12><details><summary>drawings</summary>{}</details></tr>\n", drawing);
  }
  return rows;
}

std::string timing_page(std::string_view suite, const std::vector<TimingGroup>& groups,
                        const std::string& rows, std::size_t left_out) {
  const std::string name = markup(suite);
  std::string html = fmt::format(
      "<!doctype html>\n<html lang=en><meta charset=utf-8><title>{0}: timing</title><style>{1}</style>\n"
      "<h1>{0}: timing of the devices under test</h1>\n{2}<table><tr><th>suite{3}",
      name, kTimingStyle, kTimingWords, kTimingHead);
  for (const TimingGroup& group : groups)
    html += fmt::format("<tr><td>{}{}", group_name(group), number_cells(group.all));
  html += "</table>\n";
  for (const TimingGroup& group : groups)
    html +=
        fmt::format("<h2>{}, {}</h2>\n{}", word_of(group.all.way), group_name(group), svg_timing(group.all));
  html += fmt::format("<h2>Cases</h2>\n<table><tr><th>case{}{}</table>\n", kTimingHead, rows);
  if (left_out != 0) html += fmt::format("<p>{} more cases: a JSON file has them.</p>\n", left_out);
  return html + "</html>\n";
}

}  // namespace drivebench::regression
