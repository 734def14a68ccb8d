#pragma once

#include <string>
#include <string_view>

namespace drivebench {

/// Names inside a recording.
inline constexpr std::string_view kRecordingProfile = "drivebench";
inline constexpr std::string_view kConfigurationAttachment = "bench.toml";
inline constexpr std::string_view kInputTopic = "/inputs";
inline constexpr std::string_view kVerdictTopic = "/verdict";

inline std::string sample_topic(std::string_view axis) {
  return "/" + std::string(axis) + "/sample";
}

}  // namespace drivebench
