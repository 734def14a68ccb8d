#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "clients/regression/checks/check_kinds.hpp"
#include "clients/regression/suite/case.hpp"
#include "clients/regression/verdicts/result.hpp"

namespace drivebench::regression {

/// Every rule that the case breaks on its bench goes to the list.
void check_on_bench(const Case& c, const RunFacts& facts, ProblemList& problems);

/// Sees all samples of a run and judges the case. The time of a case with an attached drive counts from the
/// tick in which the drive armed; before it only the conditions of steps are watched, as the bench does.
class Judge {
 public:
  /// The case must have no problems on this bench. `keeps_trace`: the signals of its checks are kept.
  Judge(const Case& c, const RunFacts& facts, bool keeps_trace);

  /// The samples of a tick, one for each axis, in the order of their ticks. Those after the end of the case
  /// are left out. Allocates only for a trace.
  void see(std::span<const Sample> axes);

  /// The tick of the bench in which the case began; nothing while an attached drive has not armed.
  std::optional<std::uint64_t> begin_tick() const noexcept { return begin_tick_; }
  /// Whether the case ends before this tick of the bench.
  bool is_over(std::uint64_t tick) const noexcept {
    return begin_tick_ && tick >= *begin_tick_ && tick - *begin_tick_ > end_tick_;
  }
  /// The verdict of a run that went to its end.
  CaseResult result() const;
  /// The verdict of one that did not; what the checks found stands beside it.
  CaseResult failure(Verdict verdict, std::string reason) const;

 private:
  /// Whether the condition of a step has held for long enough.
  struct StepWatch {
    AxisCondition condition;
    int line;
    std::string text;
    std::uint64_t for_ticks;
    std::optional<std::uint64_t> held_since{};
    bool has_fired = false;
  };

  void see_case(std::span<const Sample> axes);
  void add_hash(const Sample& sample) noexcept;
  void keep(std::span<const Sample> axes);
  void watch_steps(std::span<const Sample> axes) noexcept;

  const Case& case_;
  double period_s_;
  std::uint64_t end_tick_;
  std::size_t device_axis_;
  std::vector<std::unique_ptr<Check>> checks_;
  std::vector<StepWatch> steps_;
  bool keeps_trace_;
  Trace trace_;
  std::vector<WatchedValue> traced_;  ///< for the columns of the trace
  std::array<std::uint64_t, 4> lanes_;
  std::uint64_t samples_ = 0;
  std::uint64_t last_tick_ = 0;
  std::uint64_t late_ticks_ = 0;
  bool was_armed_ = false;
  std::optional<std::uint64_t> begin_tick_;
  std::uint64_t late_before_ = 0;  ///< ticks of the bench before the case
  std::vector<Sample> shifted_;    ///< samples in the time of the case
};

}  // namespace drivebench::regression
