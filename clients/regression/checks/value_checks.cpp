#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "clients/regression/checks/check_kinds.hpp"

/// Checks on the values of a signal in a window.
namespace drivebench::regression {
namespace {

/// The signal stays between two limits.
class Bounds final : public Check {
 public:
  Bounds(const CheckSpec& spec, const RunFacts& facts)
      : Check(spec, facts),
        low_(std::max(spec.number_or("min", -kInfinite), -spec.number_or("abs", kInfinite))),
        high_(std::min(spec.number_or("max", kInfinite), spec.number_or("abs", kInfinite))) {}

 private:
  void take(const Sample& sample, double value) noexcept override {
    const double excess = std::max(value - high_, low_ - value);
    if (excess <= excess_) return;
    excess_ = excess;
    worst_ = value;
    worst_tick_ = sample.tick;
  }
  Outcome outcome() const override {
    const bool is_high = worst_ - high_ >= low_ - worst_;
    const double limit = is_high ? high_ : low_;
    std::vector<double> lines;
    for (const double line : {low_, high_}) {
      if (std::isfinite(line)) lines.push_back(line);
    }
    return {
        .passed = excess_ <= 0.0,
        .measured = worst_,
        .limit = limit,
        .worst_tick = worst_tick_,
        .unit = unit(),
        .sentence = fmt::format("{} {}, {} {}", is_high ? "at most" : "at least", with_unit(worst_, unit()),
                                is_high ? "max" : "min", with_unit(limit, unit())),
        .lines = lines};
  }

  double low_;
  double high_;
  double excess_ = -kInfinite;
  double worst_ = 0.0;
  std::uint64_t worst_tick_ = 0;
};

/// The root of the mean square.
class Rms final : public Check {
 public:
  using Check::Check;

 private:
  void take(const Sample& sample, double value) noexcept override {
    sum_ += value * value;
    if (std::abs(value) <= largest_) return;
    largest_ = std::abs(value);
    worst_tick_ = sample.tick;
  }
  Outcome outcome() const override {
    const double rms = std::sqrt(sum_ / static_cast<double>(samples()));
    const double high = spec().number_or("max", kInfinite);
    const double low = spec().number_or("min", 0.0);
    const bool is_low = rms < low;
    const double limit = is_low || high == kInfinite ? low : high;
    return {.passed = !is_low && rms <= high,
            .measured = rms,
            .limit = limit,
            .worst_tick = worst_tick_,
            .unit = unit(),
            .sentence = fmt::format("rms {}, {} {}", with_unit(rms, unit()), limit == high ? "max" : "min",
                                    with_unit(limit, unit()))};
  }

  double sum_ = 0.0;
  double largest_ = -1.0;
  std::uint64_t worst_tick_ = 0;
};

/// From the smallest to the largest value.
class Ripple final : public Check {
 public:
  using Check::Check;

 private:
  void take(const Sample& sample, double value) noexcept override {
    if (value >= low_ && value <= high_) return;
    low_ = std::min(low_, value);
    high_ = std::max(high_, value);
    worst_tick_ = sample.tick;
  }
  Outcome outcome() const override {
    const double ripple = high_ - low_;
    const double limit = spec().number_or("max", kInfinite);
    return {.passed = ripple <= limit,
            .measured = ripple,
            .limit = limit,
            .worst_tick = worst_tick_,
            .unit = unit(),
            .sentence = fmt::format("ripple {} from {:.6g} to {:.6g}, max {}", with_unit(ripple, unit()),
                                    low_, high_, with_unit(limit, unit())),
            .lines = {low_, high_}};
  }

  double low_ = kInfinite;
  double high_ = -kInfinite;
  std::uint64_t worst_tick_ = 0;
};

/// The mean against a value.
class SteadyState final : public Check {
 public:
  SteadyState(const CheckSpec& spec, const RunFacts& facts)
      : Check(spec, facts), value_(spec.number_or("value", 0.0)) {}

 private:
  void take(const Sample& sample, double value) noexcept override {
    sum_ += value - value_;
    if (std::abs(value - value_) <= largest_) return;
    largest_ = std::abs(value - value_);
    worst_tick_ = sample.tick;
  }
  Outcome outcome() const override {
    const double error = sum_ / static_cast<double>(samples());
    const double limit = spec().number_or("max_error", 0.0);
    return {.passed = std::abs(error) <= limit,
            .measured = error,
            .limit = limit,
            .worst_tick = worst_tick_,
            .unit = unit(),
            .sentence = fmt::format("mean {}, {} from {:.6g}, max {}", with_unit(value_ + error, unit()),
                                    with_unit(error, unit()), value_, with_unit(limit, unit())),
            .lines = {value_ - limit, value_ + limit}};
  }

  double value_;
  double sum_ = 0.0;
  double largest_ = -1.0;
  std::uint64_t worst_tick_ = 0;
};

/// The integral of a power over time, by the trapezoidal rule.
class Energy final : public Check {
 public:
  Energy(const CheckSpec& spec, const RunFacts& facts) : Check(spec, facts), tick_s_(facts.period_s) {}

 private:
  void take(const Sample& sample, double value) noexcept override {
    if (samples() > 1) sum_j_ += 0.5 * (before_w_ + value) * tick_s_;
    before_w_ = value;
    if (std::abs(value) <= largest_w_) return;
    largest_w_ = std::abs(value);
    worst_tick_ = sample.tick;
  }
  Outcome outcome() const override {
    const double high = spec().number_or("max", kInfinite);
    const double low = spec().number_or("min", -kInfinite);
    const bool is_low = sum_j_ < low;
    const double limit = is_low || high == kInfinite ? low : high;
    return {.passed = !is_low && sum_j_ <= high,
            .measured = sum_j_,
            .limit = limit,
            .worst_tick = worst_tick_,
            .unit = "J",
            .sentence = fmt::format("energy {}, {} {}", with_unit(sum_j_, "J"), limit == high ? "max" : "min",
                                    with_unit(limit, "J"))};
  }

  double tick_s_;
  double sum_j_ = 0.0;
  double before_w_ = 0.0;
  double largest_w_ = -1.0;
  std::uint64_t worst_tick_ = 0;
};

std::string problem_with_bounds(const CheckSpec& spec) {
  const bool has_sides = spec.number("min") || spec.number("max");
  if (spec.number("abs").has_value() == has_sides) return "needs min, max or both, or else abs";
  if (spec.number_or("min", -kAnyNumber) > spec.number_or("max", kAnyNumber))
    return "has a min above its max";
  return {};
}

std::string problem_with_rms(const CheckSpec& spec) {
  if (!spec.number("min") && !spec.number("max")) return "needs min, max or both";
  return {};
}

std::string problem_with_energy(const CheckSpec& spec) {
  if (dimension_of(spec.signal->unit) != dimension_of("W"))
    return fmt::format("needs a power, but the unit of {} is {}", spec.signal->name, spec.signal->unit);
  if (!spec.number("min") && !spec.number("max")) return "needs min, max or both";
  return {};
}

constexpr auto kEnergy = std::to_array<NumberKey>(
    {{"min", false, -kAnyNumber, kAnyNumber}, {"max", false, -kAnyNumber, kAnyNumber}});
constexpr auto kBounds = std::to_array<NumberKey>({{"min", false, -kAnyNumber, kAnyNumber},
                                                   {"max", false, -kAnyNumber, kAnyNumber},
                                                   {"abs", false, 0.0, kAnyNumber}});
constexpr auto kRms =
    std::to_array<NumberKey>({{"min", false, 0.0, kAnyNumber}, {"max", false, 0.0, kAnyNumber}});
constexpr auto kRipple = std::to_array<NumberKey>({{"max", true, 0.0, kAnyNumber}});
constexpr auto kSteadyState = std::to_array<NumberKey>(
    {{"value", true, -kAnyNumber, kAnyNumber}, {"max_error", true, 0.0, kAnyNumber}});

}  // namespace

std::span<const CheckKind> value_checks() noexcept {
  static constexpr auto kKinds = std::to_array<CheckKind>(
      {{"bounds", Watches::kSignal, false, kBounds, problem_with_bounds, make_check<Bounds>},
       {"rms", Watches::kSignal, false, kRms, problem_with_rms, make_check<Rms>},
       {"ripple", Watches::kSignal, false, kRipple, nullptr, make_check<Ripple>},
       {"energy", Watches::kSignal, false, kEnergy, problem_with_energy, make_check<Energy>},
       {"steady_state", Watches::kSignal, false, kSteadyState, nullptr, make_check<SteadyState>}});
  return kKinds;
}

}  // namespace drivebench::regression
