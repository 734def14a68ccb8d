#pragma once

#include <limits>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "clients/regression/verdicts/result.hpp"

namespace drivebench::command {

/// What the checks measured over many cases.
class HtmlStatistics {
 public:
  void add(const regression::CaseResult& result);

  /// A table: for each check of each case file the number of cases, smallest, median and largest value with a
  /// histogram, and the case that came closest to its limit or went furthest beyond.
  std::string table() const;

 private:
  /// The values of a check over the cases of its file.
  struct Measure {
    std::string unit{};
    std::vector<double> values{};
    double room = std::numeric_limits<double>::infinity();  ///< to the limit; negative beyond it
    std::string closest{};                                  ///< the case with the least room
  };
  static std::string row_of(const std::pair<std::string, std::string>& place, const Measure& measure);

  std::map<std::pair<std::string, std::string>, Measure> measures_;  ///< by file and check
};

}  // namespace drivebench::command
