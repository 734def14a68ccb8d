#include "clients/regression/verdicts/judge.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <utility>

#include "protocols/nearest_name.hpp"
#include "protocols/text.hpp"

namespace drivebench::regression {
namespace {

constexpr std::array<std::uint64_t, 4> kSeeds = {0x9e3779b97f4a7c15, 0xbf58476d1ce4e5b9, 0x94d049bb133111eb,
                                                 0xd6e8feb86659fd93};
constexpr std::uint64_t kMultiplier = 0x2545f4914f6cdd1d;

constexpr std::uint64_t kRun = 1;  // a state of an axis

constexpr std::uint64_t mixed(std::uint64_t hash, std::uint64_t word) noexcept {
  return (std::rotl(hash, 29) ^ word) * kMultiplier;
}

}  // namespace

std::string_view word_of(Verdict verdict) noexcept {
  switch (verdict) {
    case Verdict::kPass:
      return "pass";
    case Verdict::kFail:
      return "fail";
    case Verdict::kError:
      return "error";
    case Verdict::kInvalid:
      return "invalid";
    case Verdict::kSkipped:
      break;
  }
  return "skipped";
}

void check_on_bench(const Case& c, const RunFacts& facts, ProblemList& problems) {
  const auto need_axis = [&](const std::string& choice, int line, const std::string& key) {
    if (find_axis(facts, choice) < facts.axes.size()) return;
    problems.add(
        c.file, line, key,
        fmt::format("is \"{}\", no axis of the bench{}", printable(choice), advice(choice, facts.axes)));
  };
  need_axis(c.device.axis, c.device.line, "dut.axis");
  const auto need_axis_of = [&](const std::optional<CaseCondition>& condition, int line,
                                const std::string& key) {
    if (condition && !condition->named.axis.empty()) need_axis(condition->named.axis, line, key);
  };
  const double end_s = static_cast<double>(facts.end_tick) * facts.period_s;
  for (const Step& step : c.steps) {
    need_axis_of(step.when, step.line, "step.when");
    if (step.at_s && *step.at_s >= end_s) {
      problems.add(c.file, step.line, "step.at_s",
                   fmt::format("is {:.6g} but the case ends at {:.6g} s", *step.at_s, end_s));
    }
  }
  for (const CheckSpec& check : c.checks) {
    need_axis(check.axis, check.line, "check.axis");
    need_axis_of(check.after, check.line, "check.after");
    need_axis_of(check.condition, check.line, "check.condition");
    for (const std::string& axis : check.formula ? check.formula->axes() : std::vector<std::string>())
      need_axis(axis, check.line, "check.formula");
    const std::string rule = problem_on_bench(check, facts);
    if (!rule.empty()) problems.add(c.file, check.line, "check", rule);
  }
}

Judge::Judge(const Case& c, const RunFacts& facts, bool keeps_trace)
    : case_(c),
      period_s_(facts.period_s),
      end_tick_(facts.end_tick),
      device_axis_(find_axis(facts, c.device.axis)),
      keeps_trace_(keeps_trace),
      lanes_(kSeeds) {
  if (c.device.kind != DeviceUnderTest::Kind::kAttached) begin_tick_ = 0;
  for (const CheckSpec& spec : c.checks) {
    const std::size_t axis = find_axis(facts, spec.axis);
    CheckSpec named = spec;
    named.axis = facts.axes[axis];
    checks_.push_back(named.kind->make(named, facts));
    const Signal* const signal = spec.signal != nullptr ? spec.signal
                                 : spec.condition       ? &kSignals[spec.condition->named.condition.signal]
                                                        : nullptr;
    const auto is_kept = [&](const Trace::Column& column) {
      return column.signal == signal && column.axis == facts.axes[axis];
    };
    if (signal == nullptr || std::ranges::any_of(trace_.columns, is_kept)) continue;
    trace_.columns.push_back({.axis = facts.axes[axis], .signal = signal, .values = {}});
    traced_.emplace_back(*signal, spec.formula, facts, axis);
  }
  for (const Step& step : c.steps) {
    if (!step.when) continue;
    steps_.push_back({.condition = AxisCondition(*step.when, facts, find_axis(facts, step.axis)),
                      .line = step.line,
                      .text = step.when->text,
                      .for_ticks = static_cast<std::uint64_t>(std::llround(step.for_s / facts.period_s))});
  }
}

void Judge::see(std::span<const Sample> axes) {
  const Sample& device = axes[device_axis_];
  if (!begin_tick_) {
    if (device.state != kRun) return watch_steps(axes);
    begin_tick_ = device.tick;
    late_before_ = device.late_ticks;
  }
  if (is_over(device.tick)) return;
  if (case_.device.kind != DeviceUnderTest::Kind::kAttached) return see_case(axes);
  shifted_.assign(axes.begin(), axes.end());
  for (Sample& sample : shifted_) {
    sample.tick -= *begin_tick_;
    sample.late_ticks -= late_before_;
  }
  see_case(shifted_);
}

void Judge::see_case(std::span<const Sample> axes) {
  const Sample& device = axes[device_axis_];
  was_armed_ = was_armed_ || device.state == kRun;
  last_tick_ = device.tick;
  late_ticks_ = device.late_ticks;
  samples_ += axes.size();
  for (const Sample& sample : axes)
    add_hash(sample);
  for (const std::unique_ptr<Check>& check : checks_)
    check->see(axes);
  watch_steps(axes);
  if (keeps_trace_) keep(axes);
}

void Judge::watch_steps(std::span<const Sample> axes) noexcept {
  for (StepWatch& step : steps_) {
    if (step.has_fired) continue;
    if (!step.condition.holds(axes)) {
      step.held_since.reset();
      continue;
    }
    if (!step.held_since) step.held_since = axes.front().tick;
    step.has_fired = axes.front().tick - *step.held_since >= step.for_ticks;
  }
}

/// Owner and late ticks differ between equal runs.
void Judge::add_hash(const Sample& sample) noexcept {
  auto words = std::bit_cast<std::array<std::uint64_t, sizeof(Sample) / 8>>(sample);
  words[offsetof(Sample, owner) / 8] = 0;
  words[offsetof(Sample, late_ticks) / 8] = 0;
  auto [first, second, third, fourth] = lanes_;  // in registers: four multiplications overlap
  std::size_t next = 0;
  for (; next + 4 <= words.size(); next += 4) {
    first = mixed(first, words[next]);
    second = mixed(second, words[next + 1]);
    third = mixed(third, words[next + 2]);
    fourth = mixed(fourth, words[next + 3]);
  }
  lanes_ = {first, second, third, fourth};
  for (; next < words.size(); ++next)
    lanes_[next % 4] = mixed(lanes_[next % 4], words[next]);
}

void Judge::keep(std::span<const Sample> axes) {
  trace_.time_s.push_back(static_cast<double>(axes[device_axis_].tick) * period_s_);
  for (std::size_t i = 0; i < trace_.columns.size(); ++i)
    trace_.columns[i].values.push_back(traced_[i].of(axes));
}

CaseResult Judge::failure(Verdict verdict, std::string reason) const {
  CaseResult result{.name = case_.name, .file = case_.file, .line = case_.line, .values = case_.values};
  result.tags = case_.tags;
  result.verdict = verdict;
  result.reason = std::move(reason);
  for (const std::unique_ptr<Check>& check : checks_)
    result.findings.push_back(check->finish());
  result.bench_s = static_cast<double>(last_tick_) * period_s_;
  result.samples = samples_;
  for (const std::uint64_t lane : lanes_)
    result.hash = mixed(result.hash, lane);
  result.trace = trace_;
  return result;
}

CaseResult Judge::result() const {
  using enum DeviceUnderTest::Kind;
  if (samples_ == 0) return failure(Verdict::kError, "the run has no samples");
  if (case_.device.kind != kNone && !was_armed_) {
    return failure(Verdict::kError, "never armed: the bench accepted no command of the device under test");
  }
  if (case_.is_realtime && late_ticks_ != 0) {
    return failure(Verdict::kInvalid, fmt::format("{} ticks of the bench were late", late_ticks_));
  }
  CaseResult result = failure(Verdict::kPass, "");
  for (const StepWatch& step : steps_) {
    if (step.has_fired) continue;
    result.reason += fmt::format("{}the step of line {} never acted: \"{}\" never held",
                                 result.reason.empty() ? "" : "; ", step.line, step.text);
  }
  const bool has_passed = result.reason.empty() && std::ranges::all_of(result.findings, &Finding::passed);
  if (!has_passed) result.verdict = Verdict::kFail;
  if (has_passed) result.trace = {};
  return result;
}

}  // namespace drivebench::regression
