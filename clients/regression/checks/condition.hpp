#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "protocols/signals/catalogue.hpp"

namespace drivebench::regression {

/// `signal op number`, with op one of > >= < <= == !=; a signal of whole numbers may have a mask before it:
/// `speed_rad_s > 100`, `faults & 4 != 0`.
class Condition {
 public:
  bool holds(const Sample& sample) const noexcept;
  const std::string& text() const noexcept { return text_; }
  const Signal& signal() const noexcept { return *signal_; }

  struct Parsed;
  static Parsed parse(std::string_view text);

 private:
  enum class Comparison { kGreater, kGreaterOrEqual, kLess, kLessOrEqual, kEqual, kNotEqual };

  std::string text_;
  const Signal* signal_ = nullptr;
  std::optional<std::uint64_t> mask_;
  Comparison comparison_ = Comparison::kGreater;
  double number_ = 0.0;
};

/// A condition, or the rule that the text breaks.
struct Condition::Parsed {
  std::optional<Condition> condition{};
  std::string problem{};
};

}  // namespace drivebench::regression
