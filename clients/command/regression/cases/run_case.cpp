#include "clients/command/regression/cases/run_case.hpp"

#include <fmt/core.h>

#include <chrono>
#include <cmath>
#include <exception>
#include <memory>
#include <optional>
#include <stdexcept>

#include "clients/command/common/session/session.hpp"
#include "clients/command/control/control_loop.hpp"
#include "clients/command/control/control_presets.hpp"
#include "clients/command/regression/cases/reference_run.hpp"
#include "clients/command/regression/cases/repeated_axis.hpp"

namespace drivebench::command {
namespace {

using regression::Case;
using regression::CaseResult;
using regression::DeviceUnderTest;
using regression::Judge;
using regression::Verdict;

constexpr std::uint64_t kRun = 1;

/// Shows every sample, and ends the loop with the case. A bench that has latched a fault refuses commands:
/// its gates stay off until the end.
class CaseWatcher final : public LoopWatcher {
 public:
  CaseWatcher(const v1::BenchDescription& bench, std::uint64_t end_tick, const SeeTick& see,
              TimeHistogram* computing)
      : latched_faults_(latched_faults(bench, ~std::uint64_t{0})),
        end_tick_(end_tick),
        see_(see),
        computing_(computing) {}

  const Sample& answered(const Sample& next) override {
    if (computing_ != nullptr) sample_came_ = Clock::now();
    return next;
  }

  Answer answering(const LoopStep& step) override {
    if (sample_came_) computing_->add(std::chrono::nanoseconds(Clock::now() - *sample_came_).count());
    see_();
    end_if_interrupted();
    if (step.sample.tick >= end_tick_) return Answer::kEnd;
    return (step.sample.faults & latched_faults_) != 0 ? Answer::kGatesOff : Answer::kSend;
  }

 private:
  std::uint64_t latched_faults_;
  std::uint64_t end_tick_;
  using Clock = std::chrono::steady_clock;

  const SeeTick& see_;
  TimeHistogram* computing_;
  std::optional<Clock::time_point> sample_came_{};
};

/// Gates off to the end of the case, or `until_armed`.
void keep_off(link::AxisLink& axis, std::uint64_t end_tick, const SeeTick& see, bool until_armed) {
  const Sample* sample = &axis.newest();
  while (sample->tick < end_tick && !(until_armed && sample->state == kRun)) {
    see();
    end_if_interrupted();
    sample = &axis.exchange({.tick = sample->tick, .gates = v1::GATES_OFF});
  }
  if (!until_armed) see();
}

CaseResult skipped(const Case& c) {
  CaseResult result{.name = c.name, .file = c.file, .line = c.line, .values = c.values};
  result.tags = c.tags;
  result.verdict = Verdict::kSkipped;
  result.reason = c.skip;
  return result;
}

/// A preset, or no device at all, on a bench in this process.
CaseResult run_in_process(const PreparedCase& prepared, const RunWishes& wishes, Judge& judge) {
  const Case& c = *prepared.what;
  const bool is_timed = wishes.timing && c.device.kind == DeviceUnderTest::Kind::kPreset;
  const auto timing = is_timed ? std::make_shared<regression::DeviceTiming>() : nullptr;
  const std::size_t place = find_axis(prepared.facts, c.device.axis);
  InprocAxis axis(prepared.bench_file.string(), c.device.axis);
  const auto see = [&] {
    judge.see(axis.all());
    if (timing) timing->missed.see(axis.all()[place]);
  };
  drive(axis, c, see,
        {.end_tick = prepared.facts.end_tick,
         .repeats = wishes.repeats,
         .computing = timing ? &timing->answers.after_sample : nullptr});
  CaseResult result = judge.result();
  if (timing) timing->period_ns = std::llround(prepared.facts.period_s * 1e9);
  result.timing = timing;
  return result;
}

CaseResult judged(const PreparedCase& wanted, const std::filesystem::path& folder, const RunWishes& wishes) {
  if (!wanted.what->skip.empty()) return skipped(*wanted.what);
  const ReferencedCase referenced(wanted);
  const PreparedCase& prepared = referenced.prepared();
  const Case& c = *prepared.what;
  Judge judge(c, prepared.facts, wishes.trace);
  try {
    end_if_interrupted();
    if (c.device.kind == DeviceUnderTest::Kind::kProgram)
      return run_program_case(prepared, folder, wishes, judge);
    if (c.device.kind == DeviceUnderTest::Kind::kAttached)
      return run_attached_case(prepared, folder, wishes, judge);
    return run_in_process(prepared, wishes, judge);
  } catch (const std::exception& error) {
    return judge.failure(Verdict::kError, error.what());
  }
}

}  // namespace

void end_if_interrupted() {
  if (interrupted()) throw std::runtime_error("interrupted");
}

void drive(link::AxisLink& bench, const Case& c, const SeeTick& see, const Drive& how) {
  std::optional<RepeatedAxis> repeated;
  if (how.repeats) repeated.emplace(bench, *how.repeats);
  link::AxisLink& axis = repeated ? static_cast<link::AxisLink&>(*repeated) : bench;
  axis.acquire();
  if (c.device.kind == DeviceUnderTest::Kind::kNone) {
    keep_off(axis, how.end_tick, see, false);
    return;
  }
  control::Run run = made(chosen_preset(c.device.preset), gains_of(c.device));
  if (axis.bench().arming_commands() > 1) keep_off(axis, how.end_tick, see, true);
  CaseWatcher watcher(axis.bench(), how.end_tick, see, how.computing);
  control_loop(axis, run, watcher);
}

CaseResult run_case(const PreparedCase& prepared, const std::filesystem::path& folder,
                    const RunWishes& wishes) {
  const auto started = std::chrono::steady_clock::now();
  CaseResult result = judged(prepared, folder, wishes);
  result.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - started).count();
  return result;
}

}  // namespace drivebench::command
