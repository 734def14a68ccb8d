#include "tests/benchmark/harness/compare.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "tests/benchmark/harness/disturbance.hpp"

namespace drivebench::speed {
namespace {

constexpr double kNoise = 0.05;

/// A figure as it is compared.
struct Figure {
  double value = 0.0;
  double least = 0.0;
  double most = 0.0;
  bool is_ratio = false;
  bool more_is_better = false;
  std::string unit;
  std::string unfit;  ///< why it is not compared
};

Figure figure_of(const nlohmann::json& row) {
  Figure figure;
  if (row.at("verdict") == "skipped") {
    figure.unfit = "skipped";
    return figure;
  }
  const Disturbance disturbance{.gone = row.at("gone_share"), .slowed = row.value("slowed_share", 0.0)};
  if (disturbance.spoils()) figure.unfit = "disturbed";
  figure.is_ratio = row.contains("ratio");
  figure.value = figure.is_ratio ? row.at("ratio") : row.at("measured");
  figure.unit = figure.is_ratio ? "x" : row.at("unit").get<std::string>();
  figure.more_is_better = row.contains("limit") && row.at("limit").contains("at_least");
  std::tie(figure.least, figure.most) =
      row.value("range", std::pair<double, double>(figure.value, figure.value));
  return figure;
}

std::string text_of(const Figure& figure) {
  return fmt::format("{:.4g}{}{}", figure.value, figure.unit.empty() ? "" : " ", figure.unit);
}

Compared judged(const std::string& name, const Figure& before, const Figure& after, bool same_machine) {
  Compared row{.name = name, .before = text_of(before), .after = text_of(after)};
  row.reason = !before.unfit.empty()               ? "before: " + before.unfit
               : !after.unfit.empty()              ? "after: " + after.unfit
               : before.is_ratio != after.is_ratio ? "one has a floor"
               : !before.is_ratio && !same_machine ? "no floor, another machine"
               : before.value <= 0.0               ? "was 0"
                                                   : "";
  if (!row.reason.empty()) return row;
  const double grown = after.value / before.value - 1.0;
  row.change = before.more_is_better ? -grown : grown;
  const bool is_apart = after.least > before.most || after.most < before.least;
  row.verdict = !is_apart || std::abs(grown) <= kNoise ? Change::kSame
                : row.change > 0.0                     ? Change::kSlower
                                                       : Change::kFaster;
  return row;
}

std::map<std::string, Figure> figures_of(const nlohmann::json& run) {
  std::map<std::string, Figure> figures;
  for (const nlohmann::json& row : run.at("rows"))
    figures.emplace(row.at("name"), figure_of(row));
  return figures;
}

const char* name_of(Change change) {
  switch (change) {
    case Change::kSlower:
      return "WORSE";
    case Change::kFaster:
      return "better";
    case Change::kNotComparable:
      return "?";
    case Change::kSame:
      break;
  }
  return "same";
}

}  // namespace

std::vector<Compared> compare(const nlohmann::json& before, const nlohmann::json& after) {
  try {
    const bool same_machine = before.at("machine") == after.at("machine");
    const std::map<std::string, Figure> old_figures = figures_of(before);
    std::vector<Compared> rows;
    for (const auto& [name, figure] : figures_of(after)) {
      const auto found = old_figures.find(name);
      if (found == old_figures.end()) {
        rows.push_back(
            {.name = name, .before = "-", .after = text_of(figure), .reason = "not measured before"});
      } else {
        rows.push_back(judged(name, found->second, figure, same_machine));
      }
    }
    // The worst first.
    std::ranges::stable_sort(rows, std::greater<>(), &Compared::change);
    return rows;
  } catch (const nlohmann::json::exception& error) {
    throw std::runtime_error(std::string("not the JSON of a benchmark: ") + error.what());
  }
}

void print_comparison(const std::vector<Compared>& rows) {
  fmt::print("{:<58} {:>16} {:>16} {:>9}  {}\n", "name", "before", "after", "change", "verdict");
  for (const Compared& row : rows) {
    const bool is_judged = row.verdict != Change::kNotComparable;
    fmt::print("{:<58} {:>16} {:>16} {:>9}  {}\n", row.name, row.before, row.after,
               is_judged ? fmt::format("{:+.1f} %", 100.0 * row.change) : "-",
               is_judged ? name_of(row.verdict) : "not compared: " + row.reason);
  }
  fmt::print(
      "\nchange: of the ratio to the floor where there is one; + is worse. same: within {:.0f} %, or within "
      "the range "
      "of the runs (--times).\n",
      100.0 * kNoise);
}

}  // namespace drivebench::speed
