#pragma once

#include <fmt/core.h>

#include <cstdio>
#include <nlohmann/json.hpp>
#include <string>

namespace drivebench {

/// Prints a line to standard output and flushes it.
inline void print_line(const std::string& line) {
  fmt::print("{}\n", line);
  std::fflush(stdout);
}

/// Prints JSON in one line. Strings that are not valid UTF-8, such as file names, get replacement characters.
inline void print_line(const nlohmann::json& line) {
  print_line(line.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
}

}  // namespace drivebench
