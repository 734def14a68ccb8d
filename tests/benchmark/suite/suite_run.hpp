#pragma once

#include <string>
#include <vector>

namespace drivebench::speed {

/// What a run of `drivebench test` cost.
struct SuiteCost {
  double wall_s;
  double resident_mib;  ///< at most
};

/// Runs `drivebench test` with these arguments, and throws std::runtime_error unless it ends with this code.
SuiteCost run_suite(const std::vector<std::string>& arguments, int code = 0);

}  // namespace drivebench::speed
