#include "clients/regression/checks/condition.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "protocols/nearest_name.hpp"
#include "protocols/text.hpp"

namespace drivebench::regression {
namespace {

constexpr std::string_view kForm =
    "; the form is: signal op number, with op one of > >= < <= == !=, and \"& mask\" before it for a signal "
    "of "
    "whole numbers";

/// Takes blanks and then a piece of the accepted characters off the front.
template <class Accepts>
std::string_view take(std::string_view& rest, Accepts accepts) {
  rest.remove_prefix(std::min(rest.find_first_not_of(' '), rest.size()));
  std::size_t length = 0;
  while (length < rest.size() && accepts(rest[length]))
    ++length;
  const std::string_view piece = rest.substr(0, length);
  rest.remove_prefix(length);
  return piece;
}

template <class Number>
std::optional<Number> number_of(std::string_view text) {
  Number value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc{} && end == text.data() + text.size() ? std::optional(value) : std::nullopt;
}

bool is_name(char c) noexcept {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
}

/// The bits of a signal of whole numbers.
std::uint64_t bits_of(const Signal& signal, const Sample& sample) noexcept {
  return signal.type == SignalType::kUnsigned ? sample.*signal.as_unsigned
                                              : static_cast<std::uint64_t>(sample.*signal.as_signed);
}

}  // namespace

bool Condition::holds(const Sample& sample) const noexcept {
  const double value =
      mask_ ? static_cast<double>(bits_of(*signal_, sample) & *mask_) : value_of(*signal_, sample);
  switch (comparison_) {
    case Comparison::kGreater:
      return value > number_;
    case Comparison::kGreaterOrEqual:
      return value >= number_;
    case Comparison::kLess:
      return value < number_;
    case Comparison::kLessOrEqual:
      return value <= number_;
    case Comparison::kEqual:
      return value == number_;
    case Comparison::kNotEqual:
      break;
  }
  return value != number_;
}

Condition::Parsed Condition::parse(std::string_view text) {
  static constexpr auto kOperators = std::to_array<std::string_view>({">", ">=", "<", "<=", "==", "!="});
  const auto refused = [&text](const std::string& why) {
    return Parsed{.problem = "is \"" + printable(text) + "\", " + why};
  };
  std::string_view rest = text;
  Condition c;
  c.text_ = text;

  const std::string_view name = take(rest, is_name);
  c.signal_ = find_signal(name);
  if (c.signal_ == nullptr) {
    return refused("but there is no signal \"" + printable(name) + '"' +
                   (name.empty() ? std::string(kForm) : did_you_mean(name, kSignals, &Signal::name)));
  }
  const auto is_operator = [](char symbol) {
    return symbol == '>' || symbol == '<' || symbol == '=' || symbol == '!' || symbol == '&';
  };
  const auto is_number = [](char symbol) { return symbol != ' ' && symbol != '&'; };
  std::string_view op = take(rest, is_operator);
  if (op == "&") {
    if (c.signal_->type == SignalType::kReal) {
      return refused("but " + std::string(name) + " is no whole number, and takes no mask");
    }
    c.mask_ = number_of<std::uint64_t>(take(rest, is_name));
    if (!c.mask_ || *c.mask_ == 0) return refused("but the mask is no positive whole number");
    op = take(rest, is_operator);
  }
  const auto found = std::ranges::find(kOperators, op);
  if (found == kOperators.end()) return refused("without a comparison" + std::string(kForm));
  c.comparison_ = static_cast<Comparison>(found - kOperators.begin());
  const std::optional<double> number = number_of<double>(take(rest, is_number));
  const bool ends = rest.find_first_not_of(' ') == std::string_view::npos;
  if (!number || !std::isfinite(*number) || !ends) {
    return refused("but one finite number must stand after the comparison");
  }
  c.number_ = *number;
  return {.condition = c};
}

}  // namespace drivebench::regression
