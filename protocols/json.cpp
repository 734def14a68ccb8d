#include "protocols/json.hpp"

#include <nlohmann/json.hpp>

namespace drivebench {
namespace {

template <class Json>
std::string text_of(const Json& value, int indent, bool ascii) {
  return value.dump(indent, ' ', ascii, Json::error_handler_t::replace);
}

}  // namespace

std::string json_text(const nlohmann::json& value, int indent) {
  return text_of(value, indent, false);
}
std::string json_text(const nlohmann::ordered_json& value, int indent) {
  return text_of(value, indent, false);
}
std::string ascii_json_text(const nlohmann::json& value) {
  return text_of(value, -1, true);
}
std::string ascii_json_text(const nlohmann::ordered_json& value) {
  return text_of(value, -1, true);
}

nlohmann::json parse_json(std::string_view text) {
  return nlohmann::json::parse(text);
}
nlohmann::ordered_json parse_ordered_json(std::string_view text) {
  return nlohmann::ordered_json::parse(text);
}

}  // namespace drivebench
