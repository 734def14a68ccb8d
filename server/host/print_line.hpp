#pragma once

#include <fmt/core.h>

#include <cstdio>
#include <nlohmann/json.hpp>
#include <string>

namespace drivebench {

/// For whoever reads standard output line by line: each is there at once.
inline void print_line(const std::string& line) {
  fmt::print("{}\n", line);
  std::fflush(stdout);
}

/// The names of files in it may be no UTF-8, which JSON is.
inline void print_line(const nlohmann::json& line) {
  print_line(line.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
}

}  // namespace drivebench
