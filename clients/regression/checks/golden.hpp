#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace drivebench::regression {

/// A signal of a recorded run, one value for each tick in rising order.
struct Golden {
  std::vector<std::uint64_t> ticks{};
  std::vector<double> values{};
  std::string problem{};  ///< the predicate of "golden ..."; empty: none
};

/// The column of a signal in a CSV file as `drivebench export` writes it: `tick,time_s,NAME [UNIT],...`.
Golden read_golden(const std::string& file, std::string_view signal);

}  // namespace drivebench::regression
