#include "clients/command/common/line_values.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <string>
#include <utility>

#include "clients/control/gains/gains.hpp"

namespace drivebench::command {
namespace {

double number(std::string_view text, std::string_view whole) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || !std::isfinite(value)) {
    throw UsageError(fmt::format("'{}' in '{}' is not a number", text, whole));
  }
  return value;
}

std::pair<std::string_view, std::string_view> split(std::string_view text, char at, std::string_view form) {
  const std::size_t place = text.find(at);
  if (place == std::string_view::npos) throw UsageError(fmt::format("'{}' should be {}", text, form));
  return {text.substr(0, place), text.substr(place + 1)};
}

}  // namespace

CLI::Validator not_negative() {
  return {[](std::string& text) {
            return text.find('-') == std::string::npos ? std::string() : text + " is negative";
          },
          ""};
}

CLI::Validator finite_between(double low, double high) {
  return {[low, high](std::string& text) {
            double value = 0.0;
            const bool good = CLI::detail::lexical_cast(text, value) && value >= low && value <= high;
            return good ? std::string()
                        : fmt::format("{} is not a number from {:g} to {:g}", text, low, high);
          },
          ""};
}

LoadAt parse_load(std::string_view text) {
  const auto [load, after] = split(text, '@', "NM@SECONDS, for example 0.1@0.0365");
  const LoadAt parsed = {.load_nm = number(load, text), .after_s = number(after, text)};
  if (parsed.after_s < 0.0 || parsed.after_s > control::kLongestRun_s) {
    throw UsageError(
        fmt::format("'{}': the time must lie between 0 and {:g} s", text, control::kLongestRun_s));
  }
  return parsed;
}

ParameterSetting parse_setting(std::string_view text) {
  const auto [name, value] = split(text, '=', "NAME=VALUE");
  return {.name = std::string(name), .value = number(value, text)};
}

}  // namespace drivebench::command
