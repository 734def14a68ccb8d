#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "clients/command/recording/recording_file.hpp"
#include "protocols/signals/sample.hpp"

namespace drivebench::command {

/// All samples of a recording, one after the other: a tick brings the axes in their order.
class RecordedSamples {
 public:
  struct Row {
    std::size_t axis;  ///< its place among the names
    Sample sample;
  };

  /// Throws UsageError if the file cannot be read.
  RecordedSamples(const std::filesystem::path& file, std::vector<std::string> axes);

  /// Nothing at the end. Throws std::runtime_error if the recording is not whole.
  std::optional<Row> next();

 private:
  MappedSeries files_;
  McapSeries mcap_;
  std::vector<std::string> axes_;
};

}  // namespace drivebench::command
