#include "clients/command/regression/pages/html_statistics.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "protocols/markup.hpp"

namespace drivebench::command {
namespace {

using regression::CaseResult;
using regression::Finding;

constexpr std::size_t kBars = 30;
constexpr int kBarWidth = 5;
constexpr int kHeight = 28;

/// The number of values in each of equal parts between the smallest and the largest.
std::array<std::size_t, kBars> counted(const std::vector<double>& sorted) {
  std::array<std::size_t, kBars> counts{};
  const double width = (sorted.back() - sorted.front()) / static_cast<double>(kBars);
  for (const double value : sorted) {
    const double part = width > 0.0 ? (value - sorted.front()) / width : 0.0;
    ++counts.at(std::min(kBars - 1, static_cast<std::size_t>(part)));
  }
  return counts;
}

std::string histogram(const std::vector<double>& sorted) {
  const std::array<std::size_t, kBars> counts = counted(sorted);
  const auto most = static_cast<double>(std::ranges::max(counts));
  std::string svg = fmt::format("<svg width={} height={} role=img aria-label=\"histogram\">",
                                static_cast<int>(kBars) * kBarWidth, kHeight);
  for (std::size_t bar = 0; bar < kBars; ++bar) {
    if (counts.at(bar) == 0) continue;
    // A single case stays visible.
    const double height = std::max(1.0, kHeight * static_cast<double>(counts.at(bar)) / most);
    svg += fmt::format("<rect x={} y={:.1f} width={} height={:.1f} fill=\"#00704f\"/>",
                       static_cast<int>(bar) * kBarWidth, kHeight - height, kBarWidth - 1, height);
  }
  return svg + "</svg>";
}

}  // namespace

void HtmlStatistics::add(const CaseResult& result) {
  for (const Finding& finding : result.findings) {
    if (!std::isfinite(finding.measured)) continue;
    Measure& measure = measures_[{result.file, finding.name}];
    measure.unit = finding.unit == "1" ? "" : finding.unit;
    measure.values.push_back(finding.measured);
    const double distance = std::abs(finding.limit - finding.measured);
    const double room = finding.passed ? distance : -distance;
    if (!(room < measure.room)) continue;
    measure.room = room;
    measure.closest = result.name;
  }
}

std::string HtmlStatistics::row_of(const std::pair<std::string, std::string>& place, const Measure& measure) {
  std::vector<double> sorted = measure.values;
  std::ranges::sort(sorted);
  const auto number = [&measure](double value) {
    return fmt::format("<td class=n>{:.6g} {}", value, markup(measure.unit));
  };
  return fmt::format("<tr><td>{}<td>{}<td class=n>{}{}{}{}<td>{}<td>{}</tr>\n", markup(place.first),
                     markup(place.second), sorted.size(), number(sorted.front()),
                     number(sorted[sorted.size() / 2]), number(sorted.back()), histogram(sorted),
                     markup(measure.closest));
}

std::string HtmlStatistics::table() const {
  std::string html =
      "<table><tr><th>file<th>check<th>cases<th>smallest<th>median<th>largest<th><th>closest to its "
      "limit</tr>\n";
  for (const auto& [place, measure] : measures_)
    html += row_of(place, measure);
  return html + "</table>\n";
}

}  // namespace drivebench::command
