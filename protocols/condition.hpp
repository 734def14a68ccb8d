#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <variant>

#include "protocols/signals/sample.hpp"

namespace drivebench {

enum class Comparison : std::uint64_t { kAbove, kAtLeast, kBelow, kAtMost, kEqual, kNotEqual };

/// A condition on a sample, such as "speed_rad_s > 100" or "faults & 4 != 0": a signal, or some bits of one
/// that is a word of bits, compared with a number.
struct Condition {
  std::uint64_t signal = 0;  ///< row of kSignals
  std::uint64_t mask = 0;    ///< the bits of an unsigned signal; 0: all
  Comparison comparison = Comparison::kAbove;
  double number = 0.0;

  /// Never of a value that is not a number, except that such a value differs from every number.
  bool holds(const Sample& sample) const noexcept;
};

/// A condition as a text names it.
struct NamedCondition {
  std::string axis;  ///< in front of the signal: "motor.speed_rad_s > 100"; empty: none
  Condition condition;
};

/// The condition, or the reason for people why the text is none: it follows "is "TEXT" but ".
std::variant<NamedCondition, std::string> parse_condition(std::string_view text);

/// The text that parse_condition() reads back as the same condition.
std::string text_of(const Condition& condition);

}  // namespace drivebench
