#include "tests/benchmark/harness/report.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <stdexcept>

namespace drivebench::speed {
namespace {

const char* name_of(Judgement judgement) {
  switch (judgement) {
    case Judgement::kWithin:
      return "within";
    case Judgement::kOver:
      return "over";
    case Judgement::kNotJudged:
      return "not judged";
    case Judgement::kForInformation:
      break;
  }
  return "-";
}

const char* key_of(Limit::Kind kind) {
  switch (kind) {
    case Limit::Kind::kRatioAtMost:
      return "ratio_at_most";
    case Limit::Kind::kExcessAtMost:
      return "excess_at_most";
    case Limit::Kind::kAtMost:
      return "at_most";
    case Limit::Kind::kAtLeast:
      break;
  }
  return "at_least";
}

/// Three significant digits, without an exponent.
std::string number(double value) {
  const double size = value < 0.0 ? -value : value;
  return fmt::format("{:.{}f}", value, size >= 100.0 || size == 0.0 ? 0 : size >= 10.0 ? 1 : 2);
}

std::string with_unit(double value, const std::string& unit) {
  return unit.empty() ? number(value) : number(value) + " " + unit;
}

std::string limit_text(const Row& row) {
  if (!row.limit) return "-";
  switch (row.limit->kind) {
    case Limit::Kind::kRatioAtMost:
      return fmt::format("<= {} x", number(row.limit->value));
    case Limit::Kind::kExcessAtMost:
      return fmt::format("<= + {}", with_unit(row.limit->value, row.unit));
    case Limit::Kind::kAtMost:
      return "<= " + with_unit(row.limit->value, row.unit);
    case Limit::Kind::kAtLeast:
      break;
  }
  return ">= " + with_unit(row.limit->value, row.unit);
}

/// The limit, and the verdict where it is not "within".
std::string judged_limit(const Row& row) {
  const Judgement verdict = judgement(row);
  if (verdict == Judgement::kForInformation) return "";
  if (verdict == Judgement::kWithin) return limit_text(row);
  return limit_text(row) + ", " + name_of(verdict);
}

}  // namespace

std::optional<double> Row::ratio() const {
  if (!floor || *floor <= 0.0) return std::nullopt;
  return measured / *floor;
}

std::vector<Row> median_of(std::vector<std::vector<Row>> runs) {
  std::vector<Row> rows = runs.front();
  if (runs.size() == 1) return rows;
  for (std::size_t n = 0; n < rows.size(); ++n) {
    std::vector<Row> same;
    for (const std::vector<Row>& run : runs) {
      if (n >= run.size() || run[n].name != rows[n].name)
        throw std::runtime_error("two runs measured different things");
      same.push_back(run[n]);
    }
    const auto figure = [](const Row& row) { return row.ratio().value_or(row.measured); };
    std::ranges::sort(same, {}, figure);
    rows[n] = same[same.size() / 2];
    if (!rows[n].skipped) rows[n].range = {figure(same.front()), figure(same.back())};
  }
  return rows;
}

Judgement judgement(const Row& row) {
  if (!row.limit) return Judgement::kForInformation;
  const Limit::Kind kind = row.limit->kind;
  const bool compares = kind == Limit::Kind::kRatioAtMost || kind == Limit::Kind::kExcessAtMost;
  const double figure = kind == Limit::Kind::kRatioAtMost    ? row.ratio().value_or(0.0)
                        : kind == Limit::Kind::kExcessAtMost ? row.measured - row.floor.value_or(0.0)
                                                             : row.measured;
  const bool within = kind == Limit::Kind::kAtLeast ? figure >= row.limit->value : figure <= row.limit->value;
  if (row.disturbance.spoils() && (compares || !within)) return Judgement::kNotJudged;
  return within ? Judgement::kWithin : Judgement::kOver;
}

std::string as_markdown(const std::string& machine, const std::string& date, const std::vector<Row>& rows) {
  std::string text = fmt::format(
      "# Speed and size\n\n"
      "Made by `./bench benchmark --markdown > tests/benchmark/RESULTS.md` on {}.\n\n"
      "{}\n\n"
      "Floor: the least that could do the job, measured in alternation in the same run. A figure is not "
      "judged when, around\nthe rounds that count, others took more than {:.0f} % of the CPUs' time or a "
      "fixed "
      "calculation ran more than {:.0f} % slower\nthan at its best.\n"
      "Where the kernel has no CAN, `taskset -c 0 tests/tools/can-vm -t 300 -- "
      "build/release/bin/drivebench-benchmark --only "
      "socketcan`\nmeasures it in a guest.\n\n"
      "| what | measured | floor | ratio | limit |\n"
      "|---|---|---|---|---|\n",
      date, machine, 100.0 * kMaxGone, 100.0 * kMaxSlowed);
  for (const Row& row : rows) {
    const std::string what = row.note.empty() ? row.name : fmt::format("{} ({})", row.name, row.note);
    if (row.skipped) {
      text += fmt::format("| {} | skipped | | | |\n", what);
      continue;
    }
    text += fmt::format("| {} | {} | {} | {} | {} |\n", what, with_unit(row.measured, row.unit),
                        row.floor ? with_unit(*row.floor, row.unit) : "",
                        row.ratio() ? number(*row.ratio()) : "", judged_limit(row));
  }
  return text;
}

void print_table(const std::string& machine, const std::vector<Row>& rows) {
  fmt::print("{}\n\n", machine);
  const auto line = [](const auto&... cells) {
    fmt::print("{:<34} {:>12} {:>12} {:>7} {:>12}  {:<10} {:>6} {:>6}  {}\n", cells...);
  };
  line("name", "measured", "floor", "ratio", "limit", "verdict", "gone", "slowed", "");
  for (const Row& row : rows) {
    if (row.skipped) {
      line(row.name, "-", "-", "-", "-", "skipped", "-", "-", row.note);
      continue;
    }
    line(row.name, with_unit(row.measured, row.unit), row.floor ? with_unit(*row.floor, row.unit) : "-",
         row.ratio() ? number(*row.ratio()) : "-", limit_text(row), name_of(judgement(row)),
         fmt::format("{:.1f} %", 100.0 * row.disturbance.gone),
         fmt::format("{:.1f} %", 100.0 * row.disturbance.slowed), row.note);
  }
  fmt::print(
      "\nfloor: the least that could do the job, measured in alternation. Around the rounds that count: "
      "gone, "
      "the share of the time\nthat others took from the CPUs; slowed, how much longer a fixed calculation "
      "took "
      "than at its best. Above {:.0f} % or {:.0f} %\na ratio is not judged.\n",
      100.0 * kMaxGone, 100.0 * kMaxSlowed);
}

nlohmann::json as_json(const std::string& machine, const std::vector<Row>& rows) {
  nlohmann::json list = nlohmann::json::array();
  for (const Row& row : rows) {
    if (row.skipped) {
      list.push_back({{"name", row.name}, {"verdict", "skipped"}, {"note", row.note}});
      continue;
    }
    nlohmann::json entry{
        {"name", row.name},
        {"unit", row.unit},
        {"measured", row.measured},
        {"verdict", judgement(row) == Judgement::kForInformation ? "information" : name_of(judgement(row))},
        {"gone_share", row.disturbance.gone},
        {"slowed_share", row.disturbance.slowed},
        {"note", row.note}};
    if (row.floor) entry["floor"] = *row.floor;
    if (row.ratio()) entry["ratio"] = *row.ratio();
    if (row.range) entry["range"] = {row.range->first, row.range->second};
    if (row.limit) entry["limit"] = {{key_of(row.limit->kind), row.limit->value}};
    list.push_back(std::move(entry));
  }
  return {{"machine", machine}, {"rows", std::move(list)}};
}

}  // namespace drivebench::speed
