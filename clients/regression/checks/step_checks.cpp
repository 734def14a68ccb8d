#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "clients/regression/checks/check_kinds.hpp"

/// Checks on the way of a signal to a value, from the first sample of the window on.
namespace drivebench::regression {
namespace {

/// From `within_s` on the signal stays in the band around the value.
class Settles final : public Check {
 public:
  Settles(const CheckSpec& spec, const RunFacts& facts)
      : Check(spec, facts), value_(spec.number_or("value", 0.0)), band_(spec.number_or("band", 0.0)) {}

 private:
  void take(const Sample& sample, double value) noexcept override {
    last_error_ = value - value_;
    if (std::abs(last_error_) > band_) outside_tick_ = sample.tick;
  }
  Outcome outcome() const override {
    const double limit_s = spec().number_or("within_s", 0.0);
    const bool has_settled = std::abs(last_error_) <= band_;
    const std::uint64_t ticks = outside_tick_ ? *outside_tick_ + 1 - first_tick() : 0;
    const double settled_s = has_settled ? seconds(ticks) : kInfinite;
    const std::string text =
        has_settled ? fmt::format("settled after {:.6g} s", settled_s)
                    : fmt::format("never settled: {} at the end", with_unit(value_ + last_error_, unit()));
    return {.passed = has_settled && within(ticks, limit_s),
            .measured = settled_s,
            .limit = limit_s,
            .worst_tick = outside_tick_.value_or(first_tick()),
            .unit = "s",
            .sentence = fmt::format("{} within {:.6g} of {:.6g}, max {:.6g} s", text, band_, value_, limit_s),
            .lines = {value_ - band_, value_ + band_}};
  }

  double value_;
  double band_;
  double last_error_ = 0.0;
  std::optional<std::uint64_t> outside_tick_{};
};

/// Progress from the first sample of the window (0) to `value` (1).
class Progress {
 public:
  explicit Progress(const CheckSpec& spec) : value_(spec.number_or("value", 0.0)) {}

  double of(double value) noexcept {
    if (!start_) start_ = value;
    return is_step() ? (value - *start_) / span() : 0.0;
  }
  bool is_step() const noexcept { return start_ && *start_ != value_; }
  double value() const noexcept { return value_; }
  double span() const noexcept { return value_ - *start_; }

 private:
  double value_;
  std::optional<double> start_{};
};

/// The part of the step by which the signal passes the value.
class Overshoot final : public Check {
 public:
  Overshoot(const CheckSpec& spec, const RunFacts& facts) : Check(spec, facts), progress_(spec) {}

 private:
  void take(const Sample& sample, double value) noexcept override {
    const double percent = 100.0 * (progress_.of(value) - 1.0);
    if (!(percent > percent_)) return;
    percent_ = percent;
    worst_tick_ = sample.tick;
  }
  Outcome outcome() const override {
    const double limit = spec().number_or("max_percent", 0.0);
    const double percent = std::max(percent_, 0.0);
    std::vector<double> lines;
    if (progress_.is_step())
      lines = {progress_.value(), progress_.value() + progress_.span() * limit / 100.0};
    return {.passed = progress_.is_step() && percent <= limit,
            .measured = percent,
            .limit = limit,
            .worst_tick = worst_tick_,
            .unit = "%",
            .sentence = progress_.is_step() ? fmt::format("overshoot {:.4g} %, max {:.4g} %", percent, limit)
                                            : "no step: the window begins at the value",
            .lines = lines};
  }

  Progress progress_;
  double percent_ = -100.0;
  std::uint64_t worst_tick_ = 0;
};

/// The time from a tenth to nine tenths of the step.
class RiseTime final : public Check {
 public:
  RiseTime(const CheckSpec& spec, const RunFacts& facts) : Check(spec, facts), progress_(spec) {}

 private:
  void take(const Sample& sample, double value) noexcept override {
    const double part = progress_.of(value);
    if (!low_tick_ && part >= 0.1) low_tick_ = sample.tick;
    if (!high_tick_ && part >= 0.9) high_tick_ = sample.tick;
  }
  Outcome outcome() const override {
    const double limit_s = spec().number_or("max_s", 0.0);
    const bool has_risen = progress_.is_step() && high_tick_.has_value();
    const std::uint64_t ticks = has_risen ? *high_tick_ - *low_tick_ : 0;
    const double rise_s = has_risen ? seconds(ticks) : kInfinite;
    return {.passed = has_risen && within(ticks, limit_s),
            .measured = rise_s,
            .limit = limit_s,
            .worst_tick = has_risen ? *high_tick_ : last_seen(),
            .unit = "s",
            .sentence = has_risen ? fmt::format("rise time {:.6g} s, max {:.6g} s", rise_s, limit_s)
                                  : fmt::format("never reached 90 % of the way to {:.6g}", progress_.value()),
            .lines = {progress_.value()}};
  }

  Progress progress_;
  std::optional<std::uint64_t> low_tick_{};
  std::optional<std::uint64_t> high_tick_{};
};

constexpr auto kSettles = std::to_array<NumberKey>({{"value", true, -kAnyNumber, kAnyNumber},
                                                    {"band", true, 0.0, kAnyNumber},
                                                    {"within_s", true, 0.0, 1e9}});
constexpr auto kOvershoot =
    std::to_array<NumberKey>({{"value", true, -kAnyNumber, kAnyNumber}, {"max_percent", true, 0.0, 1e6}});
constexpr auto kRiseTime =
    std::to_array<NumberKey>({{"value", true, -kAnyNumber, kAnyNumber}, {"max_s", true, 0.0, 1e9}});

}  // namespace

std::span<const CheckKind> step_checks() noexcept {
  static constexpr auto kKinds = std::to_array<CheckKind>(
      {{"settles", Watches::kSignal, false, kSettles, nullptr, make_check<Settles>},
       {"overshoot", Watches::kSignal, false, kOvershoot, nullptr, make_check<Overshoot>},
       {"rise_time", Watches::kSignal, false, kRiseTime, nullptr, make_check<RiseTime>}});
  return kKinds;
}

}  // namespace drivebench::regression
