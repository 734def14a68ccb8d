#include <fmt/format.h>

#include <cstdio>
#include <fstream>
#include <stdexcept>
#include <utility>

#include "clients/command/commands.hpp"
#include "clients/command/json.hpp"
#include "clients/command/servo_run.hpp"
#include "clients/command/session.hpp"

namespace drivebench::command {
namespace {

const control::Preset& chosen_preset(const std::string& name) {
  const control::Preset* preset = control::find_preset(name);
  if (preset == nullptr) {
    throw UsageError(fmt::format("no preset '{}'; did you mean {}? --list shows all", name,
                                 control::nearest_preset_name(name)));
  }
  return *preset;
}

void check_fit(const v1::BenchDescription& bench, std::uint32_t axis, const control::Preset& preset) {
  const std::vector<std::string> found = mismatches(bench, axis, preset);
  if (found.empty()) return;
  std::string text = fmt::format("preset {} does not fit this bench:", preset.name);
  for (const std::string& each : found)
    text += "\n  " + each;
  for (const control::Preset& other : control::presets()) {
    if (mismatches(bench, axis, other).empty()) text += fmt::format("\n  {} would fit", other.name);
  }
  throw UsageError(text);
}

void apply_settings(link::Link& bench, std::uint32_t axis, const std::vector<ParameterSetting>& settings) {
  for (const ParameterSetting& setting : settings) {
    try {
      bench.write_parameter(axis, setting.name, setting.value);
    } catch (const link::Refused& refused) {
      throw UsageError(fmt::format("--set {}: {}", setting.name, refused.what()));
    }
  }
}

void refuse_latched_faults(link::Link& bench, std::uint32_t axis) {
  const v1::BenchDescription& description = bench.welcome().bench();
  const std::uint64_t latched = latched_faults(description, sample_of(bench.exchange({}), axis).faults());
  if (latched == 0) return;
  throw UsageError(
      fmt::format("the axis has latched {}; --clear clears it", fault_names(description, latched)));
}

/// Leased, without latched faults and at rest, or an exception that says what to do. The load at that time.
double prepare(link::Link& bench, std::uint32_t axis, const ControlOptions& options) {
  bench.acquire(axis);
  if (options.clear_faults) {
    bench.clear_faults(axis);
  } else {
    refuse_latched_faults(bench, axis);
  }
  apply_settings(bench, axis, options.settings);
  const double load_nm = let_rest(bench, axis);
  // In lockstep no tick may have run since a fault came, so that no sample showed it before.
  if (bench.welcome().bench().mode() == v1::MODE_LOCKSTEP) refuse_latched_faults(bench, axis);
  return load_nm;
}

/// Open before the move, so that a report is not lost to a folder that does not exist.
std::ofstream opened(const std::string& file) {
  std::ofstream out;
  if (!file.empty()) out.open(file, std::ios::binary);
  if (!out) throw UsageError("cannot write " + file);
  return out;
}

void write_csv(std::ofstream out, const ControlOptions& options, const ServoRun& run) {
  if (options.csv_file.empty()) return;
  out << to_csv(run.rows);
  out.close();
  if (!out) throw std::runtime_error("cannot write " + options.csv_file);
}

void print_report(const ControlReport& r) {
  fmt::print("{} on axis {} of bench {}, {}\n", r.preset, r.axis, r.bench, r.mode);
  const auto row = [](std::string_view name, std::string_view format, double value, std::string_view unit) {
    fmt::print("  {:<34}{:>12} {}\n", name, fmt::format(fmt::runtime(format), value), unit);
  };
  row("peak error (true angle)", "{:.2f}", r.peak_error_counts, "counts");
  row("final error (encoder)", "{:.2f}", r.final_error_counts, "counts");
  row("final error (true angle)", "{:.2f}", r.final_true_error_counts, "counts");
  row("peak speed", "{:.2f}", r.peak_speed_rad_s, "rad/s");
  row("peak phase current", "{:.2f}", r.peak_current_a, "A");
  row("peak phase voltage, asked for", "{:.1f}", r.peak_command_voltage_v, "V");
  row("peak phase voltage, applied", "{:.1f}", r.peak_voltage_v, "V");
  row("duration", "{:.1f}", r.duration_s * 1e3, "ms of the bench's time");
  row("wall time", "{:.1f}", r.wall_s * 1e3, "ms");
  row("samples", "{:.0f}", static_cast<double>(r.samples), "");
  row("samples missed here", "{:.0f}", static_cast<double>(r.missed_ticks), "");
  row("late ticks of the bench", "{:.0f}", static_cast<double>(r.late_ticks), "");
  const char* what = r.mode == "realtime" ? "us, the wait for the next tick included" : "us";
  row("exchange p50", "{:.1f}", r.exchange_p50_us, what);
  row("exchange p99", "{:.1f}", r.exchange_p99_us, what);
  row("exchange max", "{:.1f}", r.exchange_max_us, what);
}

}  // namespace

int run_control(const ControlOptions& options) {
  if (options.list) {
    fmt::print("{}\n", options.json ? presets_json() : control::presets_table());
    return kExitOk;
  }
  const control::Preset& preset = chosen_preset(options.preset);
  link::Link bench = open_link(options.link, "control");
  const v1::BenchDescription& description = bench.welcome().bench();
  const std::uint32_t axis = axis_number(description, options.axis);
  check_fit(description, axis, preset);
  std::ofstream csv = opened(options.csv_file);

  catch_interrupts();
  const double load_before_nm = prepare(bench, axis, options);
  const ServoRun run = run_servo_move(bench, axis, preset, options.loads);
  if (!options.loads.empty()) bench.set_load(axis, {.load_nm = load_before_nm});
  try {
    bench.release(axis);
  } catch (const link::Refused&) {
    // The lease may have been what was lost; the report says so.
  }

  ControlReport report = summary_of(run, description.period_s());
  report.bench = description.name();
  report.mode = name_of(description.mode());
  report.axis = description.axes(static_cast<int>(axis)).name();
  report.preset = preset.name;
  if (options.json) {
    fmt::print("{}\n", control_json(report));
  } else {
    print_report(report);
  }
  write_csv(std::move(csv), options, run);
  if (report.failure.empty()) return kExitOk;
  std::fflush(stdout);
  fmt::print(stderr, "drivebench: the move did not end: {}\n", report.failure);
  return kExitFailed;
}

}  // namespace drivebench::command
