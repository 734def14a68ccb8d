#include "clients/command/recording/recording_file.hpp"

#include <fmt/core.h>

#include <system_error>

#include "clients/command/common/basics/errors.hpp"

namespace drivebench::command {

MappedSeries open_recording(const std::string& path) {
  try {
    return MappedSeries(path);
  } catch (const std::system_error& error) {
    throw UsageError(error.what());
  }
}

void refuse_other_files(const McapSeries& reader, const std::string& path) {
  if (reader.problem() && reader.problem()->kind == McapProblem::Kind::kNotMcap) {
    throw UsageError(fmt::format("{} is not a recording: {}", path, reader.problem()->what));
  }
}

std::string_view axis_of(std::string_view topic) {
  constexpr std::string_view kEnd = "/sample";
  if (!topic.starts_with('/') || !topic.ends_with(kEnd) || topic.size() <= kEnd.size() + 1) return {};
  return topic.substr(1, topic.size() - 1 - kEnd.size());
}

}  // namespace drivebench::command
