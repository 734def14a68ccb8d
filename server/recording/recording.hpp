#pragma once

#include <string>
#include <string_view>

namespace drivebench {

/// Names inside a recording.
inline constexpr std::string_view kRecordingProfile = "drivebench";
inline constexpr std::string_view kConfigurationAttachment = "bench.toml";
inline constexpr std::string_view kExperimentAttachment = "experiment.pb";  ///< a RunExperiment
inline constexpr std::string_view kInputTopic = "/inputs";
inline constexpr std::string_view kVerdictTopic = "/verdict";

/// An attachment of a recording.
struct RecordingAttachment {
  std::string_view name;
  std::string_view media_type;
  std::string_view data;
};

inline std::string sample_topic(std::string_view axis) {
  return "/" + std::string(axis) + "/sample";
}

}  // namespace drivebench
