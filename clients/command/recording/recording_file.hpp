#pragma once

#include <string>
#include <string_view>

#include "protocols/mcap/mcap_series.hpp"

/// Opens the recordings that the command line names.
namespace drivebench::command {

/// Throws UsageError if the file cannot be read.
MappedSeries open_recording(const std::string& path);

/// Throws UsageError if the file is no recording at all. A damaged one passes.
void refuse_other_files(const McapSeries& reader, const std::string& path);

/// The axis whose samples are on this topic, `/<axis>/sample`; empty for other topics.
std::string_view axis_of(std::string_view topic);

}  // namespace drivebench::command
