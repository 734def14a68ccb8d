#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

/// Writing and reading JSON texts, compiled once: nlohmann's templates cost seconds in each file that writes
/// or reads one.
namespace drivebench {

/// In one line, or indented by `indent` spaces. Bytes that are not UTF-8, such as those of file names, become
/// U+FFFD.
std::string json_text(const nlohmann::json& value, int indent = -1);
std::string json_text(const nlohmann::ordered_json& value, int indent = -1);
/// The same in one line of ASCII: everything else is escaped.
std::string ascii_json_text(const nlohmann::json& value);
std::string ascii_json_text(const nlohmann::ordered_json& value);

/// Both throw nlohmann::json::parse_error.
nlohmann::json parse_json(std::string_view text);
nlohmann::ordered_json parse_ordered_json(std::string_view text);

}  // namespace drivebench
