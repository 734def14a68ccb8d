#pragma once

#include <charconv>
#include <cmath>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

namespace drivebench::command {

/// The name of each thing, with commas between them: for errors that say what there is.
template <class Things, class Name = std::identity>
std::string listed(const Things& things, Name name = {}) {
  std::string text;
  for (const auto& each : things) {
    if (!text.empty()) text += ", ";
    text += std::invoke(name, each);
  }
  return text;
}

/// The number that the whole text is; nothing if it is none, or not finite.
inline std::optional<double> finite_number(std::string_view text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool good = error == std::errc{} && end == text.data() + text.size() && std::isfinite(value);
  return good ? std::optional(value) : std::nullopt;
}

}  // namespace drivebench::command
