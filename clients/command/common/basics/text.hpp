#pragma once

#include <charconv>
#include <cmath>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "protocols/text.hpp"

namespace drivebench::command {

/// The names of things, separated by commas, for errors that list the choices.
template <class Things, class Name = std::identity>
std::string listed(const Things& things, Name name = {}) {
  std::string text;
  for (const auto& each : things) {
    if (!text.empty()) text += ", ";
    text += std::invoke(name, each);
  }
  return text;
}

/// The finite number that the whole text spells; otherwise nothing.
inline std::optional<double> finite_number(std::string_view text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool good = error == std::errc{} && end == text.data() + text.size() && std::isfinite(value);
  return good ? std::optional(value) : std::nullopt;
}

/// A refusal with the value as the user wrote it: `1e7`, where the sentence has `is 1e+07`.
inline std::string as_written(std::string sentence, double value, std::string_view written) {
  const std::string told = " is " + shortest(value);
  const std::size_t at = sentence.find(told + ' ');
  if (at != std::string::npos) sentence.replace(at, told.size(), " is " + std::string(written));
  return sentence;
}

}  // namespace drivebench::command
