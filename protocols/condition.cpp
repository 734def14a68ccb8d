#include "protocols/condition.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <optional>

#include "protocols/nearest_name.hpp"
#include "protocols/signals/catalogue.hpp"
#include "protocols/text.hpp"

namespace drivebench {
namespace {

struct ComparisonWord {
  std::string_view word;
  Comparison comparison;
};
/// The longer words come first, because a shorter one begins them.
constexpr std::array<ComparisonWord, 6> kComparisonWords{{{">=", Comparison::kAtLeast},
                                                          {"<=", Comparison::kAtMost},
                                                          {"==", Comparison::kEqual},
                                                          {"!=", Comparison::kNotEqual},
                                                          {">", Comparison::kAbove},
                                                          {"<", Comparison::kBelow}}};

constexpr bool is_part_of_name(char c) noexcept {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-' ||
         c == '.';
}

/// What is left of a condition's text while it is read from left to right.
class Scanner {
 public:
  explicit Scanner(std::string_view text) : rest_(text) { skip_spaces(); }

  std::string_view name() {
    std::size_t length = 0;
    while (length < rest_.size() && is_part_of_name(rest_[length]))
      ++length;
    return take(length);
  }

  bool ampersand() {
    if (!rest_.starts_with('&')) return false;
    take(1);
    return true;
  }

  /// A whole number, decimal or hexadecimal with 0x.
  std::optional<std::uint64_t> bits() {
    const bool hexadecimal = rest_.starts_with("0x");
    if (hexadecimal) rest_.remove_prefix(2);
    std::uint64_t value = 0;
    const auto [end, error] =
        std::from_chars(rest_.data(), rest_.data() + rest_.size(), value, hexadecimal ? 16 : 10);
    if (error != std::errc()) return std::nullopt;
    take(static_cast<std::size_t>(end - rest_.data()));
    return value;
  }

  std::optional<Comparison> comparison() {
    for (const ComparisonWord& row : kComparisonWords) {
      if (!rest_.starts_with(row.word)) continue;
      take(row.word.size());
      return row.comparison;
    }
    return std::nullopt;
  }

  std::optional<double> number() {
    double value = 0.0;
    const auto [end, error] = std::from_chars(rest_.data(), rest_.data() + rest_.size(), value);
    if (error != std::errc() || !std::isfinite(value)) return std::nullopt;
    take(static_cast<std::size_t>(end - rest_.data()));
    return value;
  }

  bool at_end() const { return rest_.empty(); }

 private:
  std::string_view take(std::size_t length) {
    const std::string_view taken = rest_.substr(0, length);
    rest_.remove_prefix(length);
    skip_spaces();
    return taken;
  }
  void skip_spaces() {
    while (rest_.starts_with(' '))
      rest_.remove_prefix(1);
  }

  std::string_view rest_;
};

std::string unknown_signal(std::string_view name) {
  std::string why = "there is no signal '" + printable(name) + "'";
  const std::string_view nearest = nearest_name(name, kSignals, &Signal::name);
  if (!nearest.empty()) why += "; did you mean '" + std::string(nearest) + "'?";
  return why;
}

}  // namespace

bool Condition::holds(const Sample& sample) const noexcept {
  const Signal& row = kSignals[signal];
  const double value =
      mask != 0 ? static_cast<double>(sample.*row.as_unsigned & mask) : value_of(row, sample);
  switch (comparison) {
    case Comparison::kAbove:
      return value > number;
    case Comparison::kAtLeast:
      return value >= number;
    case Comparison::kBelow:
      return value < number;
    case Comparison::kAtMost:
      return value <= number;
    case Comparison::kEqual:
      return value == number;
    case Comparison::kNotEqual:
      break;
  }
  return value != number;
}

std::variant<NamedCondition, std::string> parse_condition(std::string_view text) {
  Scanner scanner(text);
  const std::string_view name = scanner.name();
  const std::size_t dot = name.rfind('.');
  const std::string_view signal = dot == std::string_view::npos ? name : name.substr(dot + 1);
  NamedCondition result;
  if (dot != std::string_view::npos) result.axis = name.substr(0, dot);
  const Signal* const row = find_signal(signal);
  if (signal.empty()) return "must be a signal, a comparison and a number, as in 'speed_rad_s > 100'";
  if (row == nullptr) return unknown_signal(signal);
  Condition& condition = result.condition;
  condition.signal = static_cast<std::uint64_t>(row - kSignals.data());
  if (scanner.ampersand()) {
    if (row->type != SignalType::kUnsigned)
      return printable(signal) + " is no word of bits: '&' does not fit";
    const std::optional<std::uint64_t> bits = scanner.bits();
    if (!bits || *bits == 0)
      return "the bits behind '&' must be a whole number above 0, as in 'faults & 4 != 0'";
    condition.mask = *bits;
  }
  const std::optional<Comparison> comparison = scanner.comparison();
  if (!comparison) return "a comparison must follow the signal: one of > >= < <= == !=";
  condition.comparison = *comparison;
  const std::optional<double> number = scanner.number();
  if (!number || !scanner.at_end()) return "one finite number must follow the comparison, and nothing else";
  condition.number = *number;
  return result;
}

std::string text_of(const Condition& condition) {
  std::string text(kSignals[condition.signal].name);
  if (condition.mask != 0) text += " & " + std::to_string(condition.mask);
  for (const ComparisonWord& row : kComparisonWords) {
    if (row.comparison == condition.comparison) text += " " + std::string(row.word) + " ";
  }
  return text + shortest(condition.number);
}

}  // namespace drivebench
