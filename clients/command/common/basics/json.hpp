#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>

#include "protocols/json.hpp"

/// JSON helpers of all rooms. The parser costs 1.4 s in every file that includes this header, so only the
/// rooms' *_json.cpp and files that print a few keys include it.
namespace nlohmann {

/// An unknown value is null.
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

/// Parses a T from a line that is a JSON object with this event (empty: any object); nothing for any other
/// line.
template <class T>
std::optional<T> parsed(std::string_view line, std::string_view event = {}) {
  try {
    const nlohmann::json object = parse_json(line);
    if (!object.is_object()) return std::nullopt;
    if (!event.empty() && object.value("event", std::string()) != event) return std::nullopt;
    return object.get<T>();
  } catch (const nlohmann::json::exception&) {
    return std::nullopt;
  }
}

}  // namespace drivebench::command
