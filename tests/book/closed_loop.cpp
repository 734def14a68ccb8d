#include "tests/book/closed_loop.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "plant/faults.hpp"
#include "server/engine/engine.hpp"
#include "tests/book/measurement_of.hpp"
#include "tests/server/parameter_row.hpp"

namespace drivebench {
namespace {

constexpr Owner kController = 1;

const control::Preset& preset_named(std::string_view name) {
  const control::Preset* const found = control::find_preset(name);
  if (found == nullptr) throw std::invalid_argument("no preset " + std::string(name));
  return *found;
}

/// Keeps the substep as long as it was, or a little shorter.
void change_rate(BenchSetup& setup, double sample_rate_hz) {
  const auto period_ns = std::llround(1e9 / sample_rate_hz);
  const double substep_ns = static_cast<double>(setup.period_ns) / setup.substeps;
  setup.substeps =
      std::max(1, static_cast<int>(std::ceil(static_cast<double>(period_ns) / substep_ns - 1e-9)));
  setup.period_ns = period_ns;
}

BenchConfig config_of(const control::Preset& preset, const ClosedLoopOptions& options) {
  const std::string name = options.bench.empty() ? std::string(preset.bench) : options.bench;
  BenchConfig config = load_config(std::string(DRIVEBENCH_CONFIGS) + "/benches/" + name + ".toml");
  AxisParameters& axis = config.setup.axes[0].parameters;
  for (const control::Gain& each : options.parameters)
    axis_parameters(axis)[row_of(axis, each.name)].set(axis, each.value);
  if (options.command_delay_ticks >= 0) config.setup.command_delay_ticks = options.command_delay_ticks;
  if (options.sample_rate_hz > 0.0) change_rate(config.setup, options.sample_rate_hz);
  return config;
}

double larger(double peak, double value) {
  return std::max(peak, std::abs(value));
}

void add_row(Outcome& seen, ClosedLoopRow row, double counts_per_rad) {
  const Sample& s = row.sample;
  seen.peak_error_rad = larger(seen.peak_error_rad, row.error_rad);
  seen.peak_error_counts = seen.peak_error_rad * counts_per_rad;
  if (row.phase != control::RunPhase::kPreparing) {
    seen.peak_error_while_moving_counts =
        larger(seen.peak_error_while_moving_counts, row.error_rad * counts_per_rad);
  }
  seen.peak_speed_rad_s = larger(seen.peak_speed_rad_s, s.speed_rad_s);
  seen.peak_speed_error_rad_s =
      larger(seen.peak_speed_error_rad_s, row.reference.speed_rad_s - s.speed_rad_s);
  for (const double current_a : {s.i_a_a, s.i_b_a, s.i_c_a})
    seen.peak_current_a = larger(seen.peak_current_a, current_a);
  seen.peak_field_current_a = larger(seen.peak_field_current_a, s.i_f_a);
  for (const double setpoint : {row.setpoint.a, row.setpoint.b, row.setpoint.c})
    seen.peak_setpoint = larger(seen.peak_setpoint, setpoint);
  for (const double voltage_v : {s.u_a_v, s.u_b_v, s.u_c_v})
    seen.peak_voltage_v = larger(seen.peak_voltage_v, voltage_v);
  seen.saturated_samples += row.saturated ? 1 : 0;
  seen.clipped_samples += (s.faults & kVoltageSaturated) != 0 ? 1 : 0;
  seen.faults = s.faults;
  ++seen.samples;
  seen.rows.push_back(std::move(row));
}

}  // namespace

std::size_t Outcome::column(std::string_view name) const {
  const auto found = std::ranges::find(telemetry_names, name);
  if (found == telemetry_names.end()) throw std::invalid_argument("no telemetry " + std::string(name));
  return static_cast<std::size_t>(found - telemetry_names.begin());
}

double Outcome::peak_of(std::string_view telemetry_name) const {
  const std::size_t index = column(telemetry_name);
  double peak = 0.0;
  for (const ClosedLoopRow& row : rows)
    peak = larger(peak, row.telemetry[index]);
  return peak;
}

ClosedLoop::ClosedLoop(std::string_view preset, const ClosedLoopOptions& options)
    : preset_(preset_named(preset)), config_(config_of(preset_, options)), bench_(config_.setup) {
  schedule_events(config_, bench_);
}

void ClosedLoop::submit(Tick tick, const Action& action) {
  const Refused refused = bench_.submit({.tick = tick, .axis = 0, .owner = kController, .action = action});
  if (refused != Refused::kNot) {
    throw std::runtime_error("the bench refused an input: " + std::to_string(static_cast<int>(refused)));
  }
}

double ClosedLoop::counts_per_rad() const {
  return value_of(config_.setup.axes[0].parameters, "encoder.counts_per_revolution") /
         (2.0 * std::numbers::pi);
}

Outcome ClosedLoop::run(std::span<const control::Gain> gains, std::span<const LoadStep> loads) {
  return run(preset_.make(gains), loads);
}

Outcome ClosedLoop::run(control::Run run, std::span<const LoadStep> loads) {
  if (std::abs(run.period_s() - period_s()) > 1e-9 * period_s()) {
    throw std::invalid_argument("the run and the bench differ in their sample rate");
  }
  submit(bench_.tick(), LeaseAction::kAcquire);
  const Tick start = bench_.tick() + run.prepare_samples();
  for (const LoadStep& load : loads) {
    submit(start + std::llround(load.after_s / period_s()),
           LoadChange{.load_nm = load.load_nm, .ramp_ticks = 0});
  }
  Outcome seen;
  const std::span<const std::string_view> names = run.controller().telemetry_names();
  seen.telemetry_names.assign(names.begin(), names.end());
  seen.rows.reserve(static_cast<std::size_t>(run.planned_samples()));
  const double start_rad = sample().angle_rad;
  while (seen.samples < run.planned_samples()) {
    const Sample now = sample();
    const control::Setpoint setpoint =
        run.step(preset_.needs.drives_second ? measurement_of(now, bench_.sample(1)) : measurement_of(now));
    const std::span<const double> telemetry = run.controller().telemetry();
    const double angle_rad = now.angle_rad - start_rad;
    const double error_rad = run.reference().angle_rad - angle_rad;
    add_row(seen,
            {.time_s = run.time_s(),
             .phase = run.phase(),
             .reference = run.reference(),
             .sample = now,
             .setpoint = setpoint,
             .angle_rad = angle_rad,
             .error_rad = error_rad,
             .saturated = run.controller().saturated(),
             .speed_estimate_rad_s = run.controller().speed_rad_s(),
             .telemetry = {telemetry.begin(), telemetry.end()}},
            counts_per_rad());
    if (seen.samples + 100 > run.planned_samples()) {
      seen.final_error_counts = larger(seen.final_error_counts, error_rad * counts_per_rad());
      seen.final_encoder_error_counts =
          larger(seen.final_encoder_error_counts,
                 (run.reference().angle_rad - run.controller().angle_rad()) * counts_per_rad());
    }
    submit(bench_.tick(),
           Command{.answers = bench_.tick(), .phases = command_of(setpoint, run.controller().quantity())});
    bench_.step();
  }
  return seen;
}

void ClosedLoop::rest(double duration_s) {
  submit(bench_.tick(), LeaseAction::kAcquire);
  const auto ticks = std::llround(duration_s / period_s());
  for (long long k = 0; k < ticks; ++k) {
    submit(bench_.tick(), Command{.answers = bench_.tick(), .phases = {.gates = Gates::kOff}});
    bench_.step();
  }
}

void ClosedLoop::set_load(double load_nm) {
  submit(bench_.tick(), LeaseAction::kAcquire);
  submit(bench_.tick(), LoadChange{.load_nm = load_nm, .ramp_ticks = 0});
}

void ClosedLoop::set_parameter(std::string_view name, double value) {
  submit(bench_.tick(), LeaseAction::kAcquire);
  submit(bench_.tick(), write_of(config_.setup.axes[0].parameters, name, value));
}

}  // namespace drivebench
