#include "clients/command/control/control.hpp"

#include <fmt/core.h>

#include <cstdio>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <utility>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/text.hpp"
#include "clients/command/common/session/session.hpp"
#include "clients/command/control/control_axis.hpp"
#include "clients/command/control/control_json.hpp"
#include "clients/command/control/control_presets.hpp"
#include "clients/command/control/control_run.hpp"
#include "clients/link/tcp/mode_name.hpp"
#include "clients/reference/preset_fit.hpp"
#include "protocols/text.hpp"

namespace drivebench::command {
namespace {

reference::AxisView view_of(const link::AxisLink& axis) {
  return {.bench = axis.bench(), .axis = axis.axis(), .known = axis.known()};
}

void check_fit(const link::AxisLink& axis, const control::Preset& preset, const ControlOptions& options,
               double sample_rate_hz) {
  const std::string text = reference::misfit_text(view_of(axis), preset, options.overrides, sample_rate_hz);
  if (!text.empty()) throw UsageError(text);
}

void apply_settings(link::AxisLink& bench, const std::vector<ParameterSetting>& settings) {
  for (const ParameterSetting& setting : settings) {
    try {
      bench.write_parameter(setting.name, setting.value);
    } catch (const link::RefusalError& refused) {
      throw UsageError(fmt::format("--set {}: {}", setting.name,
                                   as_written(refused.what(), setting.value, printable(setting.written))));
    }
  }
}

void refuse_latched_faults(link::AxisLink& bench) {
  const std::string latched = latched_text(bench.bench(), bench.newest());
  if (!latched.empty()) {
    throw UsageError(
        fmt::format("the axis has latched {}; --clear clears it, or `drivebench clear`", latched));
  }
}

/// Leases the axis and brings it to rest without latched faults, or throws with the cure.
void prepare(link::AxisLink& bench, const ControlOptions& options, double counts_per_revolution) {
  bench.acquire();
  // In lockstep no tick may have run since a fault came or was cleared: the newest sample is of before.
  const bool is_lockstep = bench.bench().mode() == v1::MODE_LOCKSTEP;
  if (options.clear_faults) bench.clear_faults();
  if (!options.clear_faults && !is_lockstep) refuse_latched_faults(bench);
  apply_settings(bench, options.settings);
  let_rest(bench, counts_per_revolution);
  if (is_lockstep) refuse_latched_faults(bench);
}

/// Opened before the move, so that a missing folder does not cost the report.
std::ofstream opened(const std::string& file) {
  std::ofstream out;
  if (!file.empty()) out.open(file, std::ios::binary);
  if (!out) throw UsageError("cannot write " + file);
  return out;
}

void write_csv(std::ofstream out, const ControlOptions& options, const ControlRun& run) {
  if (options.csv_file.empty()) return;
  out << to_csv(run);
  out.close();
  if (!out) throw std::runtime_error("cannot write " + options.csv_file);
}

void print_report(const ControlReport& r) {
  fmt::print("{} on axis {} of bench {}, {}\n", r.preset, r.axis, r.bench, r.mode);
  for (const reference::ReportRow& row : reference::rows_of(r))
    fmt::print("  {:<34}{:>12}{}{}\n", row.name, row.value, row.unit.empty() ? "" : " ", row.unit);
}

/// One move, from rest to its report.
int run_once(link::AxisLink& axis, const control::Preset& preset, const ControlOptions& options) {
  const v1::BenchDescription& description = axis.bench();
  std::ofstream csv = opened(options.csv_file);
  const double counts =
      reference::counts_per_revolution(view_of(axis), reference::needs_of(preset, options.overrides));
  prepare(axis, options, counts);
  const double load_before_nm = options.loads.empty() ? 0.0 : axis.newest().load_nm;
  ControlRun done = run_over(axis, made(preset, options.overrides), options.loads, counts,
                             options.follow > 0.0 ? 1.0 / options.follow : 0.0);
  try {
    if (!options.loads.empty()) axis.set_load({.load_nm = load_before_nm});
    axis.release();
  } catch (const link::RefusalError&) {
    // The lease may have ended; the report gives the reason.
  } catch (const link::LinkError& error) {
    if (done.failure.empty()) done.failure = error.what();
  }

  ControlReport report = summary_of(done, description.period_s());
  report.bench = description.name();
  report.mode = link::name_of(description.mode());
  report.axis = description.axes(static_cast<int>(axis.axis())).name();
  report.preset = preset.name;
  if (options.json) {
    fmt::print("{}\n", control_json(report));
  } else {
    print_report(report);
  }
  write_csv(std::move(csv), options, done);
  std::fflush(stdout);
  if (!report.failure.empty()) {
    fmt::print(stderr, "drivebench: the run did not end: {}\n", report.failure);
    return kExitFailed;
  }
  const std::vector<std::string> missed = broken(options.limits, control_json(report));
  for (const std::string& sentence : missed)
    fmt::print(stderr, "drivebench: {}\n", sentence);
  return missed.empty() ? kExitOk : kExitFailed;
}

}  // namespace

int run_control(const ControlOptions& options) {
  if (options.list || options.gains) return run_list(options);
  const control::Preset& preset = chosen_preset(options.preset);
  const double sample_rate_hz = made(preset, options.overrides).timing().sample_rate_hz;
  const std::unique_ptr<link::AxisLink> axis = open_axis(options.link, options.axis, "control");
  check_fit(*axis, preset, options, sample_rate_hz);
  if (!options.loads.empty() && !axis->can_set_load()) {
    throw UsageError("--load needs a tcp:, tls:, unix: or shm: link");
  }
  if (options.follow > 0.0 && axis->bench().mode() == v1::MODE_REALTIME) {
    throw UsageError("--follow slows a bench in lockstep down; the time of this one goes with the clock");
  }
  catch_interrupts();
  for (std::uint32_t runs = 1;; ++runs) {
    const int code = run_once(*axis, preset, options);
    if (code != kExitOk || runs == options.repeat || interrupted()) return code;
  }
}

}  // namespace drivebench::command
