#pragma once

#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace drivebench {

/// One thing that is wrong with a set of parameters.
struct Problem {
  std::string field;  ///< path of the value, for example "machine.rotor_resistance_ohm"
  std::string rule;   ///< the value and the rule it breaks, as a sentence for the user
};

/// Takes what is wrong: as sentences, or only whether anything is. The latter makes no text and allocates
/// nothing, so that the rules may be asked inside a tick.
class Problems {
 public:
  Problems() = default;
  explicit Problems(std::vector<Problem>& sentences) noexcept : sentences_(&sentences) {}

  /// `rule` is the sentence, or a callable that makes it and is called only if sentences are wanted.
  template <class Rule>
  void add(std::string_view field, const Rule& rule) {
    any_ = true;
    if (sentences_ == nullptr) return;
    if constexpr (std::is_invocable_v<const Rule&>) {
      sentences_->push_back({std::string(field), rule()});
    } else {
      sentences_->push_back({std::string(field), std::string(rule)});
    }
  }

  bool any() const noexcept { return any_; }

 private:
  std::vector<Problem>* sentences_ = nullptr;
  bool any_ = false;
};

}  // namespace drivebench
