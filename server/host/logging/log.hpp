#pragma once

#include <fmt/core.h>

#include <string>
#include <utility>

#include "server/host/logging/log_level.hpp"

/// The log of this program, on standard error. Any thread may write.
namespace drivebench::log {

/// Lines below this level are left out, with kOff all. Before the first call: kInfo.
void set_level(LogLevel level);
/// Each line is a json_log_line() from now on.
void write_json();

void write(LogLevel level, const std::string& message);
/// Why the program ends.
void critical(const std::string& message);

template <class... Values>
void info(fmt::format_string<Values...> text, Values&&... values) {
  write(LogLevel::kInfo, fmt::format(text, std::forward<Values>(values)...));
}
template <class... Values>
void warn(fmt::format_string<Values...> text, Values&&... values) {
  write(LogLevel::kWarn, fmt::format(text, std::forward<Values>(values)...));
}
template <class... Values>
void error(fmt::format_string<Values...> text, Values&&... values) {
  write(LogLevel::kError, fmt::format(text, std::forward<Values>(values)...));
}

}  // namespace drivebench::log
