#pragma once

#include <string>
#include <vector>

#include "protocols/signals/catalogue.hpp"

namespace drivebench::regression {

/// Signals of a run as they were seen, for plots.
struct Trace {
  std::vector<double> time_s{};
  struct Column {
    std::string axis;
    const Signal* signal;
    std::vector<double> values;
  };
  std::vector<Column> columns{};
};

}  // namespace drivebench::regression
