#pragma once

#include <bench.pb.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "clients/control/loop/run.hpp"
#include "clients/control/presets/presets.hpp"
#include "clients/reference/rest.hpp"
#include "clients/reference/run_report.hpp"

namespace drivebench::web {

/// A reference controller that drives an axis for a page: rest, the run of a preset, gates off.
class ReferenceRun {
 public:
  /// Throws OrderError, in the words of `drivebench control`, if there is no such preset or if it does not
  /// fit the axis. `number` is the page's: the same number is the same run.
  ReferenceRun(std::shared_ptr<const v1::BenchDescription> bench, std::uint32_t axis, std::string_view preset,
               std::uint64_t number);

  /// The newest sample of the axis.
  void take(const v1::Sample& sample);
  /// The command that answers the newest sample of the bench, that of `tick`: gates off before and after the
  /// run.
  v1::Command command(std::uint64_t tick) const;

  /// Towards standstill within so long, and then gates off.
  void wind_down(double longest_s);
  /// Gates off at once and for good. `why` is told as the reason of the end.
  void switch_off(std::string_view why);
  /// The gates are off for good.
  bool is_over() const noexcept { return stage_ == Stage::kDone || stage_ == Stage::kFailed; }

  std::uint32_t axis() const noexcept { return axis_; }
  std::uint64_t number() const noexcept { return number_; }
  std::string_view preset() const noexcept { return preset_->name; }
  /// "resting", a phase of the run, or "failed".
  std::string_view phase() const noexcept;
  double progress() const noexcept;  ///< 0 to 1, of the run
  const std::string& failure() const noexcept { return failure_; }
  /// The numbers of a run that is over.
  std::vector<reference::ReportRow> rows() const;

 private:
  enum class Stage { kResting, kRunning, kDone, kFailed };

  void rest(const Sample& sample, bool is_first);
  void step(const Sample& sample, std::int64_t periods);

  std::shared_ptr<const v1::BenchDescription> bench_;
  std::uint32_t axis_;
  const control::Preset* preset_;
  std::uint64_t number_;
  control::Run run_;
  reference::RunFacts facts_;
  reference::Rest rest_;
  reference::RunNumbers numbers_;
  Stage stage_ = Stage::kResting;
  std::string failure_{};
  std::optional<Sample> newest_{};
  control::Setpoint setpoint_{};
  double start_rad_ = 0.0;
  std::uint64_t first_late_ = 0;
  std::int64_t covered_ = 0;  // samples of the plan up to the newest one
};

/// The run that an order begins on an axis.
struct Beginning {
  std::uint32_t axis = 0;
  std::string preset{};
  std::uint64_t number = 0;
};

/// Makes the runs, each for some 30 ms at most: to be called where no axis waits for its command. Throws
/// OrderError.
std::vector<std::unique_ptr<ReferenceRun>> made_runs(const std::shared_ptr<const v1::BenchDescription>& bench,
                                                     const std::vector<Beginning>& beginnings);

/// The presets that the page offers for an axis: those that fit and drive one motor.
std::vector<const control::Preset*> offered_presets(const v1::BenchDescription& bench, std::uint32_t axis);

}  // namespace drivebench::web
