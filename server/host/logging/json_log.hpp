#pragma once

#include <chrono>
#include <string>
#include <string_view>

namespace drivebench {

/// A line of a structured log, without its end: a JSON object with `time` (UTC), `level` and `message`.
/// Whatever bytes the message has, the line is valid: those that are no UTF-8 become U+FFFD.
std::string json_log_line(std::chrono::system_clock::time_point time, std::string_view level,
                          std::string_view message);

}  // namespace drivebench
