#pragma once

#include <limits>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "clients/regression/checks/check.hpp"
#include "clients/regression/tables/key_table.hpp"

namespace drivebench::regression {

/// The value of a time that never came, or of a limit that there is not.
inline constexpr double kInfinite = std::numeric_limits<double>::infinity();

/// A key of a check that is a number.
struct NumberKey {
  std::string_view name;
  bool required;
  double minimum;
  double maximum;
};

/// What a check watches.
enum class Watches { kSignal, kCondition, kFault, kGolden, kResponse };

/// A kind of check: its keys, and how it is made.
struct CheckKind {
  std::string_view name;
  Watches watches;
  bool needs_after;
  std::span<const NumberKey> keys;
  /// The rule between numbers that the spec breaks; empty: none. May be null.
  std::string (*problem)(const CheckSpec& spec);
  std::unique_ptr<Check> (*make)(const CheckSpec& spec, const RunFacts& facts);
  /// The rule of its own that the spec breaks on a bench; empty: none. May be null.
  std::string (*problem_on_bench)(const CheckSpec& spec, const RunFacts& facts) = nullptr;
};

/// The kinds, in the order of the README.
std::span<const CheckKind> check_kinds() noexcept;

/// Whether a check of this kind fails at a sample, whatever comes after it. Others judge their window as a
/// whole, and say something else of a shorter run.
bool fails_at_once(std::string_view kind) noexcept;

/// The rule that a check breaks on this bench, such as an unknown fault or an empty window; empty: none.
std::string problem_on_bench(const CheckSpec& spec, const RunFacts& facts);

// ---- the families of kinds, each in a file of its own ----

std::span<const CheckKind> value_checks() noexcept;      ///< bounds, rms, ripple, energy, steady_state
std::span<const CheckKind> step_checks() noexcept;       ///< settles, overshoot, rise_time
std::span<const CheckKind> spectrum_checks() noexcept;   ///< thd
std::span<const CheckKind> response_checks() noexcept;   ///< frequency_response
std::span<const CheckKind> condition_checks() noexcept;  ///< always, never, eventually, reaction, fault_count
std::span<const CheckKind> tube_checks() noexcept;       ///< tube

template <class Kind>
std::unique_ptr<Check> make_check(const CheckSpec& spec, const RunFacts& facts) {
  return std::make_unique<Kind>(spec, facts);
}

}  // namespace drivebench::regression
