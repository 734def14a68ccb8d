#include "clients/regression/checks/check.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "clients/regression/checks/check_kinds.hpp"

namespace drivebench::regression {
namespace {

std::uint64_t ticks_in(double seconds, double period_s) noexcept {
  return static_cast<std::uint64_t>(std::llround(seconds / period_s));
}

}  // namespace

MultisineLines Excitation::lines(double tick_s) const noexcept {
  const auto ticks = static_cast<std::uint32_t>(
      std::clamp(std::round(period_s / tick_s), 0.0, static_cast<double>(kLongestMultisinePeriod) + 1.0));
  return {.period_ticks = ticks,
          .lowest = nearest_multiple(from_hz, ticks, tick_s),
          .highest = nearest_multiple(to_hz, ticks, tick_s),
          .ratio = ratio};
}

std::optional<double> CheckSpec::number(std::string_view key) const noexcept {
  for (const auto& [each, value] : numbers) {
    if (each == key) return value;
  }
  return std::nullopt;
}

std::size_t find_axis(const RunFacts& facts, const std::string& choice) {
  std::size_t number = 0;
  const auto [end, error] = std::from_chars(choice.data(), choice.data() + choice.size(), number);
  if (error == std::errc{} && end == choice.data() + choice.size()) {
    return std::min(number, facts.axes.size());
  }
  return static_cast<std::size_t>(std::ranges::find(facts.axes, choice) - facts.axes.begin());
}

AxisCondition::AxisCondition(const CaseCondition& condition, const RunFacts& facts, std::size_t axis)
    : condition_(condition.named.condition),
      axis_(condition.named.axis.empty() ? axis : find_axis(facts, condition.named.axis)) {}

WatchedValue::WatchedValue(const Signal& signal, std::shared_ptr<const Formula> formula,
                           const RunFacts& facts, std::size_t axis)
    : signal_(&signal), formula_(std::move(formula)), axis_(axis) {
  if (!formula_) return;
  for (const std::string& name : formula_->axes())
    places_.push_back(find_axis(facts, name));
}

Check::Check(const CheckSpec& spec, const RunFacts& facts)
    : spec_(spec),
      axis_(find_axis(facts, spec.axis)),
      facts_period_s_(facts.period_s),
      from_ticks_(ticks_in(spec.from_s, facts.period_s)),
      to_ticks_(spec.to_s ? ticks_in(*spec.to_s, facts.period_s) : facts.end_tick),
      is_open_(!spec.after),
      first_tick_(from_ticks_),
      last_tick_(to_ticks_) {
  if (spec.after) after_.emplace(*spec.after, facts, axis_);
  if (spec.condition) condition_.emplace(*spec.condition, facts, axis_);
  if (spec.signal != nullptr) value_.emplace(*spec.signal, spec.formula, facts, axis_);
}

void Check::see(std::span<const Sample> axes) noexcept {
  const Sample& sample = axes[axis_];
  if (!is_open_) {
    if (!after_->holds(axes)) return;
    is_open_ = true;
    first_tick_ = sample.tick + from_ticks_;
    last_tick_ = spec_.to_s ? sample.tick + to_ticks_ : to_ticks_;
  }
  if (sample.tick < first_tick_ || sample.tick > last_tick_) return;
  last_seen_ = sample.tick;
  ++samples_;
  if (condition_) {
    take(sample, condition_->holds(axes) ? 1.0 : 0.0);
    return;
  }
  const double value = value_ ? value_->of(axes) : 0.0;
  if (std::isfinite(value)) {
    take(sample, value);
  } else if (!not_finite_at_) {
    not_finite_at_ = sample.tick;
  }
}

bool Check::within(std::uint64_t ticks, double limit_s) const noexcept {
  return ticks <= ticks_in(limit_s, facts_period_s_);
}

Finding Check::blank() const {
  Finding finding;
  finding.name = spec_.name;
  finding.kind = spec_.kind->name;
  if (spec_.signal != nullptr) finding.signal = spec_.signal->name;
  if (spec_.condition) finding.signal = kSignals[spec_.condition->named.condition.signal].name;
  finding.axis = spec_.axis;
  finding.line = spec_.line;
  finding.from_s = seconds(first_tick_);
  finding.to_s = seconds(last_seen_);
  return finding;
}

Finding Check::finish() const {
  Finding finding = blank();
  if (!is_open_) {
    finding.sentence = fmt::format("never applied: \"{}\" never held", spec_.after->text);
    return finding;
  }
  if (samples_ == 0) {
    finding.sentence = fmt::format("never applied: no sample from {:.6g} s on", seconds(first_tick_));
    return finding;
  }
  finding.applied = true;
  if (not_finite_at_) {
    finding.at_s = seconds(*not_finite_at_);
    finding.sentence = fmt::format("{} is no finite number", spec_.signal->name);
    return finding;
  }
  Outcome found = outcome();
  finding.passed = found.passed;
  finding.measured = found.measured;
  finding.limit = found.limit;
  finding.at_s = seconds(found.worst_tick);
  finding.unit = found.unit;
  finding.sentence = std::move(found.sentence);
  finding.lines = std::move(found.lines);
  finding.response = std::move(found.response);
  return finding;
}

std::string with_unit(double value, std::string_view unit) {
  return unit.empty() || unit == "1" ? fmt::format("{:.6g}", value) : fmt::format("{:.6g} {}", value, unit);
}

}  // namespace drivebench::regression
