#pragma once

#include <array>
#include <string>
#include <string_view>

namespace drivebench {

// The words of bench files, in the order of their enumerations.
inline constexpr std::array<std::string_view, 3> kRunModeWords{"realtime", "lockstep", "free"};
inline constexpr std::array<std::string_view, 2> kPacerWords{"sleep", "sleep+spin"};
inline constexpr std::array<std::string_view, 4> kSafeActionWords{"freewheel", "zero_voltage", "hold",
                                                                  "quick_stop"};
inline constexpr std::array<std::string_view, 2> kOnExcessWords{"saturate", "refuse"};
inline constexpr std::array<std::string_view, 4> kRoleWords{"viewer", "operator", "conductor", "admin"};
inline constexpr std::array<std::string_view, 2> kAuditFailureWords{"continue", "safe"};
inline constexpr std::array<std::string_view, 5> kLogLevelWords{"debug", "info", "warn", "error", "off"};

/// The rule for a text without a folder, such as the one in a recording: untrusted text must not open files.
inline constexpr std::string_view kNoOtherFiles = "names another file, but this text must stand for itself";

// Values in TOML.
std::string in_quotes(std::string_view text);
/// A float. Without point or exponent TOML would read it as an integer, and -0 would lose its sign.
std::string real_text(double value);

}  // namespace drivebench
