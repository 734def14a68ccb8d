#include "clients/command/regression/pages/html_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "clients/command/recording/svg_plot.hpp"
#include "clients/command/regression/bundles/bundle.hpp"
#include "clients/command/regression/pages/bode_plot.hpp"
#include "protocols/markup.hpp"

namespace drivebench::command {
namespace {

using regression::CaseResult;
using regression::Finding;
using regression::Trace;
using regression::Verdict;

constexpr std::string_view kStyle =
    "body{font:14px/1.4 sans-serif;margin:2em auto;max-width:60em;color:#222}"
    "table{border-collapse:collapse;width:100%}td,th{padding:.25em .6em;border-bottom:1px solid #ddd;"
    "text-align:left;vertical-align:top}td.n{text-align:right;font-variant-numeric:tabular-nums}"
    ".pass{color:#00704f}.fail,.error{color:#b3261e;font-weight:bold}.invalid,.skipped{color:#8a5a00}"
    "pre{background:#f5f5f5;padding:.6em;overflow:auto;max-height:24em}svg{max-width:100%;height:auto}"
    "details{margin:.2em 0}h2{margin-top:2em;border-top:2px solid #ddd;padding-top:.6em}";

/// With more cases the page shows statistics, and only those that have not passed.
constexpr std::size_t kMostRows = 1000;
/// So many are shown whole, that the page stays one that a browser can show.
constexpr std::size_t kMostSections = 100;

std::string number_cell(double value, std::string_view unit) {
  if (!std::isfinite(value)) return "<td class=n>-</td>";
  return fmt::format("<td class=n>{:.6g} {}</td>", value, markup(unit == "1" ? "" : unit));
}

std::string checks_table(const CaseResult& result) {
  std::string html = "<table><tr><th>check<th>verdict<th>measured<th>limit<th>worst at [s]</tr>\n";
  for (const Finding& finding : result.findings) {
    html += fmt::format("<tr><td>{}<td class={}>{}{}{}<td class=n>{}</td></tr>\n", markup(finding.name),
                        finding.passed ? "pass" : "fail", finding.passed ? "pass" : "fail",
                        number_cell(finding.measured, finding.unit), number_cell(finding.limit, finding.unit),
                        std::isfinite(finding.at_s) ? fmt::format("{:.6g}", finding.at_s) : "-");
  }
  return html + "</table>\n";
}

/// The part of a column within the window of a check, with a tenth of it before and after.
std::string plot_of(const Finding& finding, const Trace& trace, const Trace::Column& column) {
  const double margin_s = 0.1 * (finding.to_s - finding.from_s);
  const auto begin = std::ranges::lower_bound(trace.time_s, finding.from_s - margin_s);
  const auto end = std::ranges::upper_bound(trace.time_s, finding.to_s + margin_s);
  const auto first = begin - trace.time_s.begin();
  const auto last = end - trace.time_s.begin();
  const std::vector<double> x(begin, end);
  if (x.size() < 2) return {};
  Panel panel{.label = fmt::format("{} [{}]", column.signal->name, column.signal->unit), .lines = {}};
  panel.lines.push_back({.name = std::string(column.signal->name),
                         .values = {column.values.begin() + first, column.values.begin() + last}});
  for (const double limit : finding.lines) {
    PlotLine line{.name = "limit", .values = {}};
    for (const double time_s : x) {
      const bool is_inside = time_s >= finding.from_s && time_s <= finding.to_s;
      line.values.push_back(is_inside ? limit : std::nan(""));
    }
    panel.lines.push_back(std::move(line));
  }
  return svg_of(finding.name, "time of the bench [s]", x, {panel});
}

/// A path as a link has it.
std::string percent_encoded(const std::string& path) {
  std::string text;
  for (const char c : path) {
    const bool is_plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                          std::string_view("-._~/").find(c) != std::string_view::npos;
    text += is_plain ? std::string(1, c) : fmt::format("%{:02X}", static_cast<unsigned char>(c));
  }
  return text;
}

std::string section_of(const CaseResult& result, const std::string& link) {
  const std::string_view word = word_of(result.verdict);
  std::string html = fmt::format("<h2>{} <span class={}>{}</span></h2>\n<p>{}{}</p>\n<ul>\n",
                                 markup(result.name), word, word, markup(result.file), link);
  for (const std::string& reason : reasons_of(result))
    html += fmt::format("<li>{}</li>\n", markup(reason));
  html += "</ul>\n";
  for (const std::string& plot : result.plots)
    html += plot;
  html += checks_table(result);
  if (!result.messages.empty()) {
    html += fmt::format("<p>What the device under test was told:</p>\n<pre>{}</pre>\n",
                        markup(fmt::format("{}", fmt::join(result.messages, "\n"))));
  }
  if (!result.output.empty()) {
    html += fmt::format("<p>What the device under test printed, its end:</p>\n<pre>{}</pre>\n",
                        markup(result.output));
  }
  return html;
}

std::string row_of(const CaseResult& result) {
  const std::string_view word = word_of(result.verdict);
  std::string detail;
  if (result.verdict == Verdict::kPass) {
    detail = checks_table(result);
    for (const std::string& plot : result.plots)
      detail += plot;
  }
  const std::string name = markup(result.name);
  return fmt::format(
      "<tr><td>{}<td class={}>{}<td class=n>{:.6g}<td class=n>{}</tr>\n",
      detail.empty() ? name : fmt::format("<details><summary>{}</summary>{}</details>", name, detail), word,
      word, result.bench_s, result.findings.size());
}

}  // namespace

std::vector<std::string> plots_of(const CaseResult& result) {
  std::vector<std::string> plots;
  for (const Finding& finding : result.findings) {
    if (!finding.response.empty()) plots.push_back(bode_plot(finding));
    if (finding.passed || !finding.applied) continue;
    const auto column = std::ranges::find_if(result.trace.columns, [&finding](const Trace::Column& each) {
      return each.axis == finding.axis && each.signal->name == finding.signal;
    });
    if (column != result.trace.columns.end()) plots.push_back(plot_of(finding, result.trace, *column));
  }
  return plots;
}

std::string HtmlReport::link_to_bundle(const CaseResult& result) const {
  if (bundles_.empty()) return {};
  const std::filesystem::path bundle = bundle_of(bundles_, result.name);
  std::error_code error;
  if (!std::filesystem::exists(bundle, error)) return {};
  const std::filesystem::path from = page_folder_.empty() ? "." : page_folder_;
  const std::string path = std::filesystem::relative(bundle, from, error).generic_string();
  return fmt::format(", <a href=\"{}\">bundle</a> for drivebench rerun", percent_encoded(path));
}

void HtmlReport::add(const CaseResult& result) {
  statistics_.add(result);
  const bool is_good = regression::is_good(result);
  const std::string row = row_of(result);
  if (cases_++ < kMostRows) rows_ += row;
  if (is_good) return;
  if (bad_ < kMostRows) bad_rows_ += row;
  if (bad_++ < kMostSections) sections_ += section_of(result, link_to_bundle(result));
}

std::string HtmlReport::page(const std::string& suite, const regression::Totals& totals) const {
  const bool are_many = cases_ > kMostRows;
  const std::string name = markup(suite);
  std::string html = fmt::format(
      "<!doctype html>\n<html lang=en><meta charset=utf-8><title>{0}</title><style>{1}</style>\n"
      "<h1>{0}</h1>\n<p>{2}</p>\n{3}<table><tr><th>case<th>verdict<th>bench time [s]<th>checks</tr>\n"
      "{4}</table>\n{5}",
      name, kStyle, regression::totals_text(totals), are_many ? statistics_.table() : "",
      are_many ? bad_rows_ : rows_, sections_);
  if (bad_ > kMostSections)
    html += fmt::format("<p>{} more have not passed; the JSON report has them.</p>\n", bad_ - kMostSections);
  return html + "</html>\n";
}

}  // namespace drivebench::command
