#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <limits>
#include <optional>

#include "clients/regression/checks/check_kinds.hpp"

/// Checks on conditions and on bits of the fault word.
namespace drivebench::regression {
namespace {

/// Counts the samples on which the condition is not as wanted.
class OnEverySample : public Check {
 protected:
  OnEverySample(const CheckSpec& spec, const RunFacts& facts, bool wanted)
      : Check(spec, facts), wanted_(wanted) {}

 private:
  void take(const Sample& sample, double value) noexcept override {
    if ((value != 0.0) == wanted_) return;
    if (count_++ == 0) first_wrong_ = sample.tick;
  }
  Outcome outcome() const override {
    std::string text =
        fmt::format("\"{}\" {} throughout", spec().condition->text, wanted_ ? "holds" : "does not hold");
    if (count_ != 0) {
      text = fmt::format("\"{}\" {} at {:.6g} s, in {} of {} samples", spec().condition->text,
                         wanted_ ? "does not hold" : "holds", seconds(first_wrong_), count_, samples());
    }
    return {.passed = count_ == 0,
            .measured = static_cast<double>(count_),
            .limit = 0.0,
            .worst_tick = count_ != 0 ? first_wrong_ : first_tick(),
            .unit = "samples",
            .sentence = text};
  }

  bool wanted_;
  std::uint64_t count_ = 0;
  std::uint64_t first_wrong_ = 0;
};

class Always final : public OnEverySample {
 public:
  Always(const CheckSpec& spec, const RunFacts& facts) : OnEverySample(spec, facts, true) {}
};

class Never final : public OnEverySample {
 public:
  Never(const CheckSpec& spec, const RunFacts& facts) : OnEverySample(spec, facts, false) {}
};

/// The first sample of the window on which the condition holds.
class FirstHold : public Check {
 protected:
  using Check::Check;
  std::optional<std::uint64_t> held() const noexcept { return held_; }

 private:
  void take(const Sample& sample, double value) noexcept override {
    if (!held_ && value != 0.0) held_ = sample.tick;
  }

  std::optional<std::uint64_t> held_{};
};

class Eventually final : public FirstHold {
 public:
  using FirstHold::FirstHold;

 private:
  Outcome outcome() const override {
    const double window_s = seconds(last_seen() - first_tick());
    const double after_s = held() ? seconds(*held() - first_tick()) : kInfinite;
    return {.passed = held().has_value(),
            .measured = after_s,
            .limit = window_s,
            .worst_tick = held().value_or(last_seen()),
            .unit = "s",
            .sentence = held() ? fmt::format("\"{}\" holds after {:.6g} s", spec().condition->text, after_s)
                               : fmt::format("\"{}\" never holds in the window of {:.6g} s",
                                             spec().condition->text, window_s)};
  }
};

/// The condition follows the trigger within some ticks.
class Reaction final : public FirstHold {
 public:
  using FirstHold::FirstHold;

 private:
  Outcome outcome() const override {
    const double limit = spec().number_or("within_ticks", 0.0);
    const double ticks = held() ? static_cast<double>(*held() - first_tick()) : kInfinite;
    const std::string& reaction = spec().condition->text;
    return {.passed = ticks <= limit,
            .measured = ticks,
            .limit = limit,
            .worst_tick = held().value_or(last_seen()),
            .unit = "ticks",
            .sentence = held()
                            ? fmt::format("\"{}\" {} ticks after \"{}\", max {}", reaction, ticks,
                                          spec().after->text, limit)
                            : fmt::format("\"{}\" never holds after \"{}\"", reaction, spec().after->text)};
  }
};

/// How often a fault bit rises; one that is set in the first sample of the window has risen, too.
class FaultCount final : public Check {
 public:
  FaultCount(const CheckSpec& spec, const RunFacts& facts)
      : Check(spec, facts), bit_(std::ranges::find(facts.faults, spec.fault, &RunFacts::Fault::name)->bit) {}

 private:
  void take(const Sample& sample, double) noexcept override {
    const bool is_set = (sample.faults & bit_) != 0;
    if (is_set && !was_set_ && count_++ == 0) first_rise_ = sample.tick;
    was_set_ = is_set;
  }
  Outcome outcome() const override {
    const double count = static_cast<double>(count_);
    const double low = spec().number_or("min", 0.0);
    const double high = spec().number_or("max", spec().number("min") ? kInfinite : 0.0);
    const double limit = count < low ? low : high;
    std::string text = fmt::format("{} rose {} times, ", spec().fault, count_);
    text += count < low ? fmt::format("min {}", low) : fmt::format("max {}", high);
    return {.passed = count >= low && count <= high,
            .measured = count,
            .limit = limit,
            .worst_tick = count_ != 0 ? first_rise_ : first_tick(),
            .unit = "times",
            .sentence = text};
  }

  std::uint64_t bit_;
  bool was_set_ = false;
  std::uint64_t count_ = 0;
  std::uint64_t first_rise_ = 0;
};

constexpr auto kReaction = std::to_array<NumberKey>({{"within_ticks", true, 0.0, 1e9}});
constexpr auto kFaultCount = std::to_array<NumberKey>({{"min", false, 0.0, 1e9}, {"max", false, 0.0, 1e9}});

}  // namespace

std::span<const CheckKind> condition_checks() noexcept {
  static constexpr auto kKinds = std::to_array<CheckKind>(
      {{"always", Watches::kCondition, false, {}, nullptr, make_check<Always>},
       {"never", Watches::kCondition, false, {}, nullptr, make_check<Never>},
       {"eventually", Watches::kCondition, false, {}, nullptr, make_check<Eventually>},
       {"reaction", Watches::kCondition, true, kReaction, nullptr, make_check<Reaction>},
       {"fault_count", Watches::kFault, false, kFaultCount, nullptr, make_check<FaultCount>}});
  return kKinds;
}

}  // namespace drivebench::regression
