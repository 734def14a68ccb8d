#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <string_view>

/// Wall time in RFC 3339, for the expiry of tokens and the audit log.
namespace drivebench {

/// Parses "2026-11-22T18:00:00Z", also with an offset such as "+01:00", from 1970 to 2199, without fractions
/// and leap seconds.
std::optional<std::chrono::sys_seconds> parse_rfc3339(std::string_view text);

/// UTC with microseconds: "2026-11-22T18:00:00.000000Z".
std::string rfc3339(std::chrono::system_clock::time_point time);

}  // namespace drivebench
