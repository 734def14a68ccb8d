#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

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
  double gone = 0.0;              ///< share of the time that the canary found gone
  std::string note{};
  bool skipped = false;  ///< not measured; the note says why

  std::optional<double> ratio() const;
};

/// kNotJudged: too much time was gone. A figure within its limit stays so: disturbances can only have spoiled
/// it.
enum class Judgement { kWithin, kOver, kNotJudged, kForInformation };
Judgement judgement(const Row& row);

/// The contents of tests/benchmark/RESULTS.md. The date is `YYYY-MM-DD`.
std::string as_markdown(const std::string& machine, const std::string& date, const std::vector<Row>& rows);
void print_table(const std::string& machine, const std::vector<Row>& rows);
nlohmann::json as_json(const std::string& machine, const std::vector<Row>& rows);

}  // namespace drivebench::speed
