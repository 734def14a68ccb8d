#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "tests/benchmark/harness/machine.hpp"

namespace drivebench::speed {

/// The value below which this share (0..1) of all values lies. There must be one value.
inline double percentile(std::vector<double> values, double share) {
  const auto rank = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), values.begin() + rank, values.end());
  return values[static_cast<std::size_t>(rank)];
}

/// Median over all results of `figure` (a member or a function).
template <class Result, class Figure>
double median(const std::vector<Result>& results, Figure figure) {
  std::vector<double> values;
  for (const Result& result : results)
    values.push_back(std::invoke(figure, result));
  return percentile(std::move(values), 0.5);
}

struct Percentiles {
  double p50 = 0.0;
  double p99 = 0.0;
};

inline Percentiles percentiles(const std::vector<double>& values) {
  return {.p50 = percentile(values, 0.5), .p99 = percentile(values, 0.99)};
}

/// Wall time of so many exchanges [us].
template <class Exchange>
Percentiles time_exchanges(std::size_t count, Exchange exchange) {
  std::vector<double> us(count);
  for (double& each : us) {
    const std::int64_t begin = now_ns();
    exchange();
    each = static_cast<double>(now_ns() - begin) * 1e-3;
  }
  return percentiles(us);
}

}  // namespace drivebench::speed
