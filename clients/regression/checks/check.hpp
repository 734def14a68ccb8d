#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "clients/regression/checks/frequency_response.hpp"
#include "clients/regression/checks/golden.hpp"
#include "clients/regression/formulas/formula.hpp"
#include "protocols/condition.hpp"
#include "protocols/multisine.hpp"
#include "protocols/signals/catalogue.hpp"

namespace drivebench::regression {

struct CheckKind;

/// A condition as a case file has it.
struct CaseCondition {
  std::string text;
  NamedCondition named;
};

/// The multisine of a step, as its case file has it.
struct Excitation {
  bool is_load;      ///< else the offset of the current sensors
  double amplitude;  ///< of each line
  double begin_s;    ///< of the bench's time, or since the trigger of its step
  bool has_trigger;
  double period_s;
  double periods;
  double from_hz;
  double to_hz;
  double ratio;

  MultisineLines lines(double tick_s) const noexcept;
};

/// A check as its case file asks for it.
struct CheckSpec {
  const CheckKind* kind = nullptr;
  std::string name;
  int line = 0;
  std::string axis{};              ///< name or number; empty: that of the device under test
  const Signal* signal = nullptr;  ///< or the label of the formula
  std::shared_ptr<const Formula> formula{};
  double from_s = 0.0;           ///< of the window; with `after`, since the trigger
  std::optional<double> to_s{};  ///< empty: to the end
  bool has_window = false;       ///< from_s or after stands in the case file
  std::optional<CaseCondition> after{};
  std::optional<CaseCondition> condition{};
  std::string fault{};
  std::string golden_file{};
  std::string reference{};                        ///< a preset whose run on the same bench is the golden one
  std::shared_ptr<const Golden> reference_run{};  ///< once it has run
  std::optional<std::size_t> step{};              ///< that excites what the check measures
  std::optional<Excitation> excitation{};         ///< of that step
  std::vector<std::pair<std::string_view, double>> numbers{};  ///< the other keys

  std::optional<double> number(std::string_view key) const noexcept;
  double number_or(std::string_view key, double otherwise) const noexcept {
    return number(key).value_or(otherwise);
  }
};

/// What a check must know of the bench before the run.
struct RunFacts {
  struct Fault {
    std::string name;
    std::uint64_t bit;
  };
  double period_s = 0.0;
  std::uint64_t end_tick = std::numeric_limits<std::uint64_t>::max();  ///< the last sample, if it is known
  std::vector<std::string> axes{};
  std::vector<Fault> faults{};
};

/// The axis of the bench with this name or number, or the number of axes if there is none.
std::size_t find_axis(const RunFacts& facts, const std::string& choice);

/// A condition on the samples of a tick.
class AxisCondition {
 public:
  /// Without a name in front of its signal it is about `axis`.
  AxisCondition(const CaseCondition& condition, const RunFacts& facts, std::size_t axis);
  bool holds(std::span<const Sample> axes) const noexcept { return condition_.holds(axes[axis_]); }

 private:
  Condition condition_;
  std::size_t axis_;
};

/// The value of a signal or a formula in the samples of a tick.
class WatchedValue {
 public:
  /// `signal` is the label of the formula, if there is one.
  WatchedValue(const Signal& signal, std::shared_ptr<const Formula> formula, const RunFacts& facts,
               std::size_t axis);
  double of(std::span<const Sample> axes) const noexcept {
    return formula_ ? formula_->value(axes, axis_, places_) : value_of(*signal_, axes[axis_]);
  }

 private:
  const Signal* signal_;
  std::shared_ptr<const Formula> formula_;
  std::size_t axis_;
  std::vector<std::size_t> places_{};  ///< of the formula's other axes
};

/// The outcome of a check.
struct Finding {
  std::string name;
  std::string kind;
  std::string signal;  ///< that it is about, or its formula; empty: a fault
  std::string axis;
  std::string unit;  ///< of the numbers
  bool passed = false;
  bool applied = false;  ///< false: its window was empty, or its trigger never came
  double measured = std::numeric_limits<double>::quiet_NaN();
  double limit = std::numeric_limits<double>::quiet_NaN();
  double at_s = std::numeric_limits<double>::quiet_NaN();  ///< where it was worst
  double from_s = 0.0;                                     ///< the window, in the time of the bench
  double to_s = 0.0;
  std::vector<double> lines{};            ///< limits of the signal, for a plot
  std::vector<ResponsePoint> response{};  ///< of a frequency_response
  std::string sentence{};                 ///< for people
  int line = 0;                           ///< in the case file
};

/// Sees the samples of every tick in their order and judges them at the end.
class Check {
 public:
  Check(const CheckSpec& spec, const RunFacts& facts);
  Check(const Check&) = delete;
  Check& operator=(const Check&) = delete;
  virtual ~Check() = default;

  /// One sample for each axis. Does not allocate.
  void see(std::span<const Sample> axes) noexcept;
  Finding finish() const;

  const CheckSpec& spec() const noexcept { return spec_; }

 protected:
  /// What a kind of check found in its window.
  struct Outcome {
    bool passed;
    double measured;
    double limit;
    std::uint64_t worst_tick;
    std::string_view unit;
    std::string sentence;
    std::vector<double> lines{};
    std::vector<ResponsePoint> response{};
  };

  double seconds(std::uint64_t ticks) const noexcept { return static_cast<double>(ticks) * facts_period_s_; }
  /// Whether so many ticks are at most so many seconds; times are rounded to ticks, as everywhere.
  bool within(std::uint64_t ticks, double limit_s) const noexcept;
  std::uint64_t first_tick() const noexcept { return first_tick_; }
  std::uint64_t last_seen() const noexcept { return last_seen_; }
  std::uint64_t samples() const noexcept { return samples_; }
  std::string_view unit() const noexcept { return spec_.signal != nullptr ? spec_.signal->unit : ""; }

 private:
  /// A sample of the window; `value` is that of the signal, or whether the condition holds, 1 or 0.
  virtual void take(const Sample& sample, double value) noexcept = 0;
  virtual Outcome outcome() const = 0;

  Finding blank() const;

  CheckSpec spec_;
  std::size_t axis_;
  std::optional<AxisCondition> after_{};
  std::optional<AxisCondition> condition_{};
  std::optional<WatchedValue> value_{};
  double facts_period_s_;
  std::uint64_t from_ticks_;
  std::uint64_t to_ticks_;
  bool is_open_;  ///< the trigger has come, or there is none
  std::uint64_t first_tick_ = 0;
  std::uint64_t last_tick_ = 0;
  std::uint64_t last_seen_ = 0;
  std::uint64_t samples_ = 0;
  std::optional<std::uint64_t> not_finite_at_{};
};

/// A value and the unit, for sentences.
std::string with_unit(double value, std::string_view unit);

}  // namespace drivebench::regression
