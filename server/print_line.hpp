#pragma once

#include <fmt/core.h>

#include <cstdio>
#include <string>

namespace drivebench {

/// For whoever reads standard output line by line: each is there at once.
inline void print_line(const std::string& line) {
  fmt::print("{}\n", line);
  std::fflush(stdout);
}

}  // namespace drivebench
