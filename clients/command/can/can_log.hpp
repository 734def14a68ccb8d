#pragma once

#include <cstdint>
#include <string>

namespace drivebench::command {

struct CanLogOptions {
  std::string address{};
  std::string out_file{};   ///< empty: standard output
  std::uint64_t count = 0;  ///< frames; 0: until interrupted
  double duration_s = 0.0;  ///< of wall time; 0: until interrupted
};
int run_can_log(const CanLogOptions& options);

}  // namespace drivebench::command
