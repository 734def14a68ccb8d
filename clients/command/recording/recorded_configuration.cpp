#include "clients/command/recording/recorded_configuration.hpp"

#include <algorithm>

namespace drivebench::command {

std::optional<ConfigNode> recorded_configuration(const McapReader& file) {
  constexpr std::string_view kConfiguration = "bench.toml";
  for (const McapAttachment& attachment : file.attachments()) {
    if (attachment.name != kConfiguration) continue;
    ProblemList problems;
    return parse_document({reinterpret_cast<const char*>(attachment.data.data()), attachment.data.size()},
                          std::string(kConfiguration), problems, kMaxRecordedConfigBytes);
  }
  return std::nullopt;
}

const ConfigNode* child_of(const ConfigNode& table, std::string_view key) {
  const auto found = std::ranges::find(table.children, key, &ConfigNode::key);
  return found == table.children.end() ? nullptr : &*found;
}

std::string text_of(const ConfigNode& table, std::string_view key) {
  const ConfigNode* const node = child_of(table, key);
  const auto* const text = node == nullptr ? nullptr : std::get_if<std::string>(&node->scalar);
  return text == nullptr ? "" : *text;
}

}  // namespace drivebench::command
