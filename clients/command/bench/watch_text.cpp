#include "clients/command/bench/watch_text.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <string_view>

#include "protocols/number_text.hpp"

namespace drivebench::command {
namespace {

struct Prefix {
  double factor;
  std::string_view text;
};
constexpr auto kPrefixes = std::to_array<Prefix>(
    {{1e9, "G"}, {1e6, "M"}, {1e3, "k"}, {1.0, ""}, {1e-3, "m"}, {1e-6, "µ"}, {1e-9, "n"}});

/// Units that take no prefix.
constexpr auto kPlainUnits =
    std::to_array<std::string_view>({"1", "enum", "bits", "counts", "ticks", "rad", "rad/s", "K"});

constexpr std::array<std::string_view, 8> kBlocks = {"▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"};
constexpr std::array<std::string_view, 8> kMarks = {"_", ".", ":", "-", "=", "+", "*", "#"};

double displayed(const Signal& signal, const Sample& sample) {
  const double value = value_of(signal, sample);
  if (signal.type != SignalType::kReal) return value;
  const double usual = std::max(std::abs(signal.minimum), std::abs(signal.maximum));
  return std::abs(value) < 1e-11 * usual ? 0.0 : value;
}

bool is_one_of(std::string_view unit, std::span<const std::string_view> units) {
  return std::ranges::find(units, unit) != units.end();
}

}  // namespace

std::string shown_value(const Signal& signal, const Sample& sample) {
  if (signal.type != SignalType::kReal) return fmt::format("{:.0f}", value_of(signal, sample));
  return number_text(displayed(signal, sample));
}

std::string value_with_unit(const Signal& signal, const Sample& sample, bool utf8) {
  const bool has_unit = !is_one_of(signal.unit, std::array<std::string_view, 3>{"1", "enum", "bits"});
  const std::string unit = has_unit ? fmt::format(" {}", signal.unit) : std::string();
  const double value = displayed(signal, sample);
  if (is_one_of(signal.unit, kPlainUnits) || value == 0.0 || !std::isfinite(value))
    return shown_value(signal, sample) + unit;
  // Rounded to the five digits that are shown, so that 999.999 mA is 1 A.
  const double rounded = std::stod(fmt::format("{:.4e}", std::abs(value)));
  const auto row =
      std::ranges::find_if(kPrefixes, [rounded](const Prefix& each) { return rounded >= each.factor; });
  const Prefix prefix = row == kPrefixes.end() ? kPrefixes.back() : *row;
  const std::string_view text = prefix.text == "µ" && !utf8 ? "u" : prefix.text;
  return fmt::format("{} {}{}", number_text(value / prefix.factor), text, signal.unit);
}

bool has_curve(const Signal& signal) noexcept {
  return signal.unit != "enum" && signal.unit != "bits" && signal.unit != "ticks";
}

std::string sparkline(std::span<const double> values, std::size_t width, bool utf8) {
  const std::span<const double> newest = values.last(std::min(values.size(), width));
  if (newest.size() < 2) return {};
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const double value : newest) {
    if (!std::isfinite(value)) continue;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  const auto& columns = utf8 ? kBlocks : kMarks;
  std::string line;
  for (const double value : newest) {
    if (!std::isfinite(value)) {
      line += ' ';
      continue;
    }
    const double share = high > low ? (value - low) / (high - low) : 0.0;
    line += columns[static_cast<std::size_t>(std::clamp(share * 8.0, 0.0, 7.0))];
  }
  return line;
}

bool speaks_utf8() {
  for (const char* const name : {"LC_ALL", "LC_CTYPE", "LANG"}) {
    const char* const value = std::getenv(name);
    if (value == nullptr || *value == '\0') continue;
    const std::string_view locale(value);
    return locale.find("UTF-8") != std::string_view::npos || locale.find("utf8") != std::string_view::npos;
  }
  return false;
}

}  // namespace drivebench::command
