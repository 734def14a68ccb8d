#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tests/benchmark/harness/disturbance.hpp"

namespace drivebench::speed {

/// The limit of a figure.
struct Limit {
  enum class Kind {
    kRatioAtMost,   ///< measured / floor
    kExcessAtMost,  ///< measured - floor
    kAtMost,
    kAtLeast,
  };
  Kind kind;
  double value;
};

/// One figure.
struct Row {
  std::string name;
  std::string unit{};  ///< empty: a number
  double measured = 0.0;
  std::optional<double> floor{};  ///< the same for the least program that does the job, in the same run
  std::optional<Limit> limit{};   ///< none: for information
  Disturbance disturbance{};      ///< what the canary noticed
  std::string note{};
  bool skipped = false;  ///< not measured; the note says why

  /// Of several runs, lowest and highest: of the ratio where there is a floor, of the figure otherwise.
  std::optional<std::pair<double, double>> range{};

  std::optional<double> ratio() const;
};

/// The rows of several runs of one measurement, each as in the run whose ratio (or figure) is the median,
/// with its range.
std::vector<Row> median_of(std::vector<std::vector<Row>> runs);

/// kNotJudged: others took too much. A figure within its limit stays so: disturbances can only have spoiled
/// it.
enum class Judgement { kWithin, kOver, kNotJudged, kForInformation };
Judgement judgement(const Row& row);

/// The contents of tests/benchmark/RESULTS.md. The date is `YYYY-MM-DD`.
std::string as_markdown(const std::string& machine, const std::string& date, const std::vector<Row>& rows);
void print_table(const std::string& machine, const std::vector<Row>& rows);
nlohmann::json as_json(const std::string& machine, const std::vector<Row>& rows);

}  // namespace drivebench::speed
