#include "clients/command/control/control_limits.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string_view>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/json.hpp"
#include "clients/command/control/control_json.hpp"
#include "protocols/json.hpp"
#include "protocols/nearest_name.hpp"
#include "protocols/text.hpp"

namespace drivebench::command {
namespace {

/// The numbers of a report, also those that only some links carry.
std::vector<std::string> known_names() {
  std::vector<std::string> names;
  const Json report = parse_ordered_json(control_json(ControlReport{}));
  for (const auto& [name, value] : report.items()) {
    if (value.is_number() || value.is_null()) names.push_back(name);
  }
  return names;
}

double number_of(std::string_view text, const std::string& whole) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || !std::isfinite(value)) {
    throw UsageError(
        fmt::format("--expect {}: '{}' must be a finite number", printable(whole), printable(text)));
  }
  return value;
}

}  // namespace

Limit parse_limit(const std::string& text) {
  std::size_t at = text.find("<=");
  const bool at_most = at != std::string::npos;
  if (!at_most) at = text.find(">=");
  if (at == std::string::npos) {
    throw UsageError(fmt::format("--expect {}: must be NAME<=NUMBER or NAME>=NUMBER", printable(text)));
  }
  const std::string name = text.substr(0, at);
  const std::vector<std::string> names = known_names();
  if (std::ranges::find(names, name) == names.end()) {
    throw UsageError(fmt::format("--expect {}: no number '{}' in the report{}; it has {}", printable(text),
                                 printable(name), did_you_mean(name, names), fmt::join(names, ", ")));
  }
  return {.name = name, .at_most = at_most, .value = number_of(std::string_view(text).substr(at + 2), text)};
}

std::vector<std::string> broken(const std::vector<Limit>& limits, const std::string& report_json) {
  std::vector<std::string> sentences;
  const Json report = parse_ordered_json(report_json);
  for (const Limit& limit : limits) {
    const std::string wanted =
        fmt::format("{} {} {}", limit.name, limit.at_most ? "<=" : ">=", shortest(limit.value));
    const Json& found = report.at(limit.name);
    if (!found.is_number()) {
      sentences.push_back(
          fmt::format("expected {}, but this link does not carry what it follows from", wanted));
      continue;
    }
    const auto value = found.get<double>();
    if (limit.at_most ? value <= limit.value : value >= limit.value) continue;
    sentences.push_back(fmt::format("expected {}, but it is {}", wanted, shortest(value)));
  }
  return sentences;
}

}  // namespace drivebench::command
