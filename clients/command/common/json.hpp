#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>

/// What the rooms share of JSON. The parser costs 1.4 s in every file that includes this one, so only the
/// rooms' own *_json.cpp do, and what prints a few keys.
namespace nlohmann {

/// A value that is not known is null.
template <class T>
struct adl_serializer<std::optional<T>> {
  template <class Json>
  static void to_json(Json& out, const std::optional<T>& value) {
    out = value ? Json(*value) : Json(nullptr);
  }
  template <class Json>
  static void from_json(const Json& in, std::optional<T>& value) {
    value = in.is_null() ? std::nullopt : std::optional<T>(in.template get<T>());
  }
};

}  // namespace nlohmann

namespace drivebench::command {

using Json = nlohmann::ordered_json;

/// A T from a line that is a JSON object, and has this event unless it is empty; nothing of any other line.
template <class T>
std::optional<T> parsed(std::string_view line, std::string_view event = {}) {
  try {
    const nlohmann::json object = nlohmann::json::parse(line);
    if (!object.is_object()) return std::nullopt;
    if (!event.empty() && object.value("event", std::string()) != event) return std::nullopt;
    return object.get<T>();
  } catch (const nlohmann::json::exception&) {
    return std::nullopt;
  }
}

}  // namespace drivebench::command
