#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <string_view>

/// Wall time as RFC 3339 has it, where people meet it: tokens that end, the audit log. Nothing else in the
/// server looks at the wall clock.
namespace drivebench {

/// "2026-11-22T18:00:00Z", or with an offset as "+01:00", from 1970 to 2199. Nothing else: no fractions, no
/// leap seconds.
std::optional<std::chrono::sys_seconds> parse_rfc3339(std::string_view text);

/// UTC with microseconds: "2026-11-22T18:00:00.000000Z".
std::string rfc3339(std::chrono::system_clock::time_point time);

}  // namespace drivebench
