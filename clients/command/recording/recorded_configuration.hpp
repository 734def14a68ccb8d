#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "protocols/document.hpp"
#include "protocols/mcap/mcap.hpp"

/// The configuration of the bench in a recording.
namespace drivebench::command {

/// Nothing if the recording has none that can be read. Known once all messages have been read.
std::optional<ConfigNode> recorded_configuration(const McapReader& file);

/// The value of this key; null: there is none.
const ConfigNode* child_of(const ConfigNode& table, std::string_view key);
/// The text of this key; empty: there is none.
std::string text_of(const ConfigNode& table, std::string_view key);

}  // namespace drivebench::command
