#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "clients/regression/formulas/units.hpp"
#include "protocols/signals/catalogue.hpp"

namespace drivebench::regression {

/// A value of every tick that is computed from signals, such as "u_a_v*i_a_a - 2.4 [ohm]*i_a_a^2": numbers
/// with their units in brackets, signals (of another axis as NAME.signal), + - * / ^ with a whole exponent,
/// brackets, abs, sqrt, min, max and sign. Its unit follows from those of its parts; what does not fit is
/// refused. There are no sines: their last bit depends on the library of the machine, and equal runs have
/// equal reports.
class Formula {
 public:
  /// The formula, or the reason for people why the text is none: it follows "is "TEXT" but ".
  static std::variant<std::shared_ptr<const Formula>, std::string> parse(std::string_view text);

  const Dimension& dimension() const noexcept { return dimension_; }
  /// The names of other axes in it, in their order; bind() needs their places.
  const std::vector<std::string>& axes() const noexcept { return axes_; }
  /// Its text and its unit, as a signal has them. It is no member of a sample.
  const Signal& label() const noexcept { return label_; }

  /// The value of a tick. `places`: the number of each of axes(). Does not allocate.
  double value(std::span<const Sample> samples, std::size_t axis,
               std::span<const std::size_t> places) const noexcept;

 private:
  friend class FormulaParser;
  enum class Code : std::uint8_t {
    kNumber,
    kSignal,
    kAdd,
    kSubtract,
    kMultiply,
    kDivide,
    kPower,
    kNegate,
    kAbs,
    kSqrt,
    kMin,
    kMax,
    kSign
  };
  /// A step of a stack machine.
  struct Step {
    Code code;
    double number = 0.0;  ///< or the exponent
    const Signal* signal = nullptr;
    int other_axis = -1;  ///< of axes(); -1: that of the check
  };
  static constexpr std::size_t kDeepest = 32;  ///< values on the stack

  Formula() = default;
  Formula(const Formula&) = delete;
  Formula& operator=(const Formula&) = delete;

  std::vector<Step> steps_;
  std::vector<std::string> axes_;
  Dimension dimension_{};
  std::string text_;
  std::string unit_;
  Signal label_{};
};

}  // namespace drivebench::regression
