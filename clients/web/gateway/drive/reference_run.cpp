#include "clients/web/gateway/drive/reference_run.hpp"

#include <fmt/core.h>

#include <stdexcept>
#include <utility>

#include "clients/link/common/requests.hpp"
#include "clients/link/tcp/tcp_link.hpp"
#include "clients/reference/answers.hpp"
#include "clients/reference/fault_text.hpp"
#include "clients/reference/preset_fit.hpp"
#include "clients/web/gateway/drive/open_loop.hpp"
#include "clients/web/gateway/drive/orders.hpp"
#include "protocols/nearest_name.hpp"
#include "protocols/text.hpp"

namespace drivebench::web {
namespace {

using reference::AxisView;

const control::Preset& ordered_preset(std::string_view name) {
  const control::Preset* const preset = control::find_preset(name);
  if (preset == nullptr)
    throw OrderError(fmt::format("no preset '{}'{}", printable(name),
                                 did_you_mean(name, control::presets(), &control::Preset::name)));
  if (preset->needs.drives_second)
    throw OrderError(
        fmt::format("preset {} drives two motors, which the page cannot: `drivebench control "
                    "--preset {}` does",
                    preset->name, preset->name));
  return *preset;
}

/// The run of a preset that fits the axis.
control::Run fitting_run(const AxisView& view, const control::Preset& preset) {
  try {
    control::Run run = preset.make({});
    const std::string misfit = reference::misfit_text(view, preset, {}, run.timing().sample_rate_hz);
    if (misfit.empty()) return run;
    throw OrderError(misfit);
  } catch (const std::invalid_argument& error) {
    throw OrderError(fmt::format("preset {}: {}", preset.name, error.what()));
  }
}

}  // namespace

ReferenceRun::ReferenceRun(std::shared_ptr<const v1::BenchDescription> bench, std::uint32_t axis,
                           std::string_view preset, std::uint64_t number)
    : bench_(std::move(bench)),
      axis_(axis),
      preset_(&ordered_preset(preset)),
      number_(number),
      run_(fitting_run({.bench = *bench_, .axis = axis}, *preset_)),
      facts_(reference::facts_of(
          run_, kAllSignals,
          reference::counts_per_revolution({.bench = *bench_, .axis = axis}, preset_->needs))),
      rest_(bench_->period_s(), 0.0, kAllSignals),
      numbers_(facts_, bench_->period_s()) {}

void ReferenceRun::take(const v1::Sample& message) {
  if (is_over()) return;
  const Sample sample = link::plain(message);
  const bool is_first = !newest_;
  const std::uint64_t before = is_first ? sample.tick - 1 : newest_->tick;
  newest_ = sample;
  if (sample.tick == before) return;
  if (!is_first && sample.tick < before) return switch_off("the bench has gone back in time");
  if (stage_ == Stage::kResting) return rest(sample, is_first);
  step(sample, static_cast<std::int64_t>(sample.tick - before));
}

void ReferenceRun::rest(const Sample& sample, bool is_first) {
  using reference::Rest;
  const bool is_needless = is_first && Rest::is_needless(*bench_, sample);
  const Rest::State state = is_needless ? Rest::State::kStill : rest_.see(sample);
  if (state == Rest::State::kGoesOn) return;
  if (state == Rest::State::kTurns)
    return switch_off(
        fmt::format("the shaft turns at {:.3g} rad/s; the run starts from rest", rest_.speed_rad_s()));
  const std::string latched = reference::latched_text(*bench_, sample);
  if (!latched.empty())
    return switch_off(fmt::format("the axis has latched {}; Clear faults clears it", latched));
  stage_ = Stage::kRunning;
  start_rad_ = sample.angle_rad;
  first_late_ = sample.late_ticks;
  step(sample, 1);
}

void ReferenceRun::step(const Sample& sample, std::int64_t periods) {
  const control::Measurement measured = reference::measurement_of(sample, kAllSignals);
  setpoint_ = run_.step(measured, periods);
  if (run_.done()) {
    stage_ = Stage::kDone;
    return;
  }
  covered_ += periods;
  numbers_.add(reference::row_of(sample, facts_, periods, start_rad_, run_, setpoint_),
               run_.controller().telemetry());
  const std::string found = reference::obstacle(*bench_, sample, measured, false);
  if (!found.empty()) switch_off(found);
}

v1::Command ReferenceRun::command(std::uint64_t tick) const {
  v1::Command command;
  command.set_axis(axis_);
  command.set_tick(stage_ == Stage::kRunning ? newest_->tick : tick);
  command.set_gates(v1::GATES_OFF);
  if (stage_ != Stage::kRunning) return command;
  const link::AxisCommand answer =
      reference::command_for(newest_->tick, setpoint_, run_.controller().quantity());
  command.set_gates(answer.gates);
  put_setpoints(command, link::setpoints_of(answer));
  return command;
}

void ReferenceRun::wind_down(double longest_s) {
  if (stage_ == Stage::kRunning) return run_.wind_down(longest_s);
  switch_off("it had not begun");
}

void ReferenceRun::switch_off(std::string_view why) {
  if (is_over()) return;
  stage_ = Stage::kFailed;
  failure_ = why;
}

std::string_view ReferenceRun::phase() const noexcept {
  if (stage_ == Stage::kResting) return "resting";
  return stage_ == Stage::kFailed ? "failed" : control::name_of(run_.phase());
}

double ReferenceRun::progress() const noexcept {
  return stage_ == Stage::kDone ? 1.0
                                : static_cast<double>(covered_) / static_cast<double>(run_.planned_samples());
}

std::vector<reference::ReportRow> ReferenceRun::rows() const {
  if (!is_over() || covered_ == 0) return {};
  reference::ControlReport report = numbers_.report();
  report.late_ticks = newest_->late_ticks - first_late_;
  if (stage_ == Stage::kDone) report.missed_ticks += run_.planned_samples() - covered_;
  return reference::rows_of(report);
}

std::vector<std::unique_ptr<ReferenceRun>> made_runs(const std::shared_ptr<const v1::BenchDescription>& bench,
                                                     const std::vector<Beginning>& beginnings) {
  std::vector<std::unique_ptr<ReferenceRun>> runs;
  runs.reserve(beginnings.size());
  for (const Beginning& each : beginnings)
    runs.push_back(std::make_unique<ReferenceRun>(bench, each.axis, each.preset, each.number));
  return runs;
}

std::vector<const control::Preset*> offered_presets(const v1::BenchDescription& bench, std::uint32_t axis) {
  if (!bench.axes(static_cast<int>(axis)).shares_amplifier_with().empty()) return {};
  std::vector<const control::Preset*> offered = reference::fitting_presets({.bench = bench, .axis = axis});
  std::erase_if(offered, [](const control::Preset* each) { return each->needs.drives_second; });
  return offered;
}

}  // namespace drivebench::web
