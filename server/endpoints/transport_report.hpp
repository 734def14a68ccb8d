#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace drivebench {

/// How a transport is doing, for whoever asks the bench.
struct TransportReport {
  std::string name;   ///< for example "can socketcan:vcan0"
  std::string state;  ///< "up", or what is wrong
  std::vector<std::pair<std::string_view, std::uint64_t>> counts;
};

}  // namespace drivebench
