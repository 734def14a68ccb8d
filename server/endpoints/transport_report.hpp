#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace drivebench {

/// State and counts of a transport, for the status of the bench.
struct TransportReport {
  std::string name;   ///< for example "can socketcan:vcan0"
  std::string state;  ///< "up", or the problem
  std::vector<std::pair<std::string_view, std::uint64_t>> counts;
};

}  // namespace drivebench
