#pragma once

#include <fmt/core.h>

#include <cstdio>
#include <string>

#include "protocols/json.hpp"

namespace drivebench {

/// Prints a line to standard output and flushes it.
inline void print_line(const std::string& line) {
  fmt::print("{}\n", line);
  std::fflush(stdout);
}

/// Prints JSON in one line. Strings that are not valid UTF-8, such as file names, get replacement characters.
inline void print_line(const nlohmann::json& line) {
  print_line(json_text(line));
}

}  // namespace drivebench
