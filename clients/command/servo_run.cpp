#include "clients/command/servo_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>
#include <numbers>
#include <optional>

#include "clients/command/session.hpp"

namespace drivebench::command {
namespace {

using Clock = std::chrono::steady_clock;

double larger(double peak, double value) noexcept {
  return std::max(peak, std::abs(value));
}

double microseconds(Clock::duration duration) noexcept {
  return std::chrono::duration<double, std::micro>(duration).count();
}

/// The value below which this part of the sorted values lies.
double quantile(const std::vector<double>& sorted, double part) noexcept {
  if (sorted.empty()) return 0.0;
  return sorted[static_cast<std::size_t>(part * static_cast<double>(sorted.size() - 1))];
}

std::optional<double> parameter(const v1::AxisDescription& axis, std::string_view name) {
  for (const v1::ParameterDescription& row : axis.parameters()) {
    if (row.name() == name) return row.value();
  }
  return std::nullopt;
}

bool differ(double a, double b) noexcept {
  return std::abs(a - b) > 1e-9 * std::abs(b);
}

/// The tick k of the run is the bench's `first_tick` + k.
void schedule_loads(link::AxisLink& bench, const control::ServoPreset& preset, const std::vector<LoadAt>& loads,
                    std::uint64_t first_tick) {
  for (const LoadAt& load : loads) {
    const double after_s = preset.move.flux_build_up_s + load.after_s;
    const auto ticks = static_cast<std::uint64_t>(std::llround(after_s * preset.controller.sample_rate_hz));
    bench.set_load({.load_nm = load.load_nm, .ramp_ticks = 0, .at_tick = first_tick + ticks});
  }
}

/// The angle of the shaft as the link lets us know it.
double angle_of(const Sample& sample, const ServoRun& run, double counts_per_rad) {
  return run.knows_angle ? sample.angle_rad : static_cast<double>(sample.encoder_count) / counts_per_rad;
}

ServoRow row_of(const Sample& sample, const ServoRun& run, std::int64_t periods, double start_rad,
                const control::ServoMove& move, double counts_per_rad) {
  ServoRow row = {.tick = sample.tick, .periods = periods, .time_s = move.time_s()};
  row.reference_rad = move.reference().angle_rad;
  row.angle_rad = angle_of(sample, run, counts_per_rad) - start_rad;
  row.error_counts = (row.reference_rad - row.angle_rad) * counts_per_rad;
  row.measured_error_counts = move.output().position_error_counts;
  row.speed_observer_rad_s = move.output().speed_observer_rad_s;
  row.speed_rad_s = run.knows_speed ? sample.speed_rad_s : row.speed_observer_rad_s;
  row.speed_difference_rad_s = move.output().speed_difference_rad_s;
  row.i_a_a = sample.i_a_a;
  row.i_b_a = sample.i_b_a;
  row.command_a_v = move.output().u_a_v;
  row.command_b_v = move.output().u_b_v;
  row.u_a_v = sample.u_a_v;
  row.u_b_v = sample.u_b_v;
  return row;
}

/// Why the move cannot go on with this sample; empty if it can.
std::string obstacle(const link::AxisLink& bench, const Sample& sample, bool is_first) {
  if (interrupted()) return "interrupted";
  if (!std::isfinite(sample.i_a_a) || !std::isfinite(sample.i_b_a)) {
    return fmt::format("the sample of tick {} has no currents", sample.tick);
  }
  const std::string latched = latched_text(bench.bench(), sample);
  // In lockstep the first sample is from before the faults were cleared.
  return latched.empty() || is_first ? "" : "the bench latched " + latched;
}

}  // namespace

std::vector<std::string> mismatches(const v1::BenchDescription& bench, std::uint32_t axis,
                                    const control::ServoPreset& preset) {
  std::vector<std::string> found;
  const v1::AxisDescription& there = bench.axes(static_cast<int>(axis));
  const control::ControllerParameters& here = preset.controller;
  const auto must_equal = [&](std::string_view what, std::optional<double> value, double expected) {
    if (value && differ(*value, expected)) {
      found.push_back(fmt::format("{} is {:g} on the bench, {:g} in the preset", what, *value, expected));
    }
  };
  must_equal("the sample rate [Hz]", 1.0 / bench.period_s(), here.sample_rate_hz);
  must_equal("encoder.counts_per_revolution", parameter(there, "encoder.counts_per_revolution"),
             here.counts_per_revolution);
  must_equal("machine.pole_pairs", parameter(there, "machine.pole_pairs"), here.machine.pole_pairs);
  const std::optional<double> limit_v = parameter(there, "amplifier.voltage_limit_v");
  if (limit_v && *limit_v < here.voltage_limit_v) {
    found.push_back(fmt::format("amplifier.voltage_limit_v is {:g} on the bench, the preset uses up to {:g}",
                                *limit_v, here.voltage_limit_v));
  }
  return found;
}

void let_rest(link::AxisLink& bench, double counts_per_revolution) {
  constexpr double kRest_s = 0.050;
  constexpr double kStill_rad_s = 1.0;  // holding a position against the steps of the encoder leaves 0.2
  const Sample start = bench.newest();
  if (start.tick == 0) return;
  const double rest_ticks = kRest_s / bench.bench().period_s();
  Sample half_way = start;
  Sample sample = start;
  while (static_cast<double>(sample.tick - start.tick) < rest_ticks) {
    if (static_cast<double>(sample.tick - start.tick) < rest_ticks / 2) half_way = sample;
    sample = bench.exchange({.tick = sample.tick, .gates = v1::GATES_OFF});
  }
  // A count within the second half is 0.13 rad/s.
  const double turned_rad = static_cast<double>(sample.encoder_count - half_way.encoder_count) *
                            (2.0 * std::numbers::pi / counts_per_revolution);
  const double counted_rad_s =
      turned_rad / (static_cast<double>(sample.tick - half_way.tick) * bench.bench().period_s());
  const double speed_rad_s = bench.knows("speed_rad_s") ? sample.speed_rad_s : counted_rad_s;
  if (std::abs(speed_rad_s) > kStill_rad_s) {
    throw UsageError(fmt::format("the shaft turns at {:.3g} rad/s; the move starts from rest", speed_rad_s));
  }
}

ServoRun run_servo_move(link::AxisLink& bench, const control::ServoPreset& preset,
                        const std::vector<LoadAt>& loads) {
  const double counts_per_rad = preset.controller.counts_per_revolution / (2.0 * std::numbers::pi);
  control::ServoMove move(preset.controller, preset.move);
  ServoRun run;
  run.knows_angle = bench.knows("angle_rad");
  run.knows_speed = bench.knows("speed_rad_s");
  run.knows_voltage = bench.knows("u_a_v");
  run.rows.reserve(static_cast<std::size_t>(move.planned_samples()));
  Progress progress("control");
  const Clock::time_point started = Clock::now();

  const Sample* sample = &bench.newest();
  const double start_rad = angle_of(*sample, run, counts_per_rad);
  const std::uint64_t first_late = sample->late_ticks;
  std::int64_t periods = 1;
  try {
    for (;;) {
      const control::ControlOutput& output = move.step(
          {.encoder_count = sample->encoder_count, .i_a_a = sample->i_a_a, .i_b_a = sample->i_b_a}, periods);
      run.late_ticks = sample->late_ticks - first_late;
      if (move.done()) break;
      run.rows.push_back(row_of(*sample, run, periods, start_rad, move, counts_per_rad));
      ServoRow& row = run.rows.back();
      run.failure = obstacle(bench, *sample, run.rows.size() == 1);
      if (!run.failure.empty()) break;

      const Clock::time_point asked = Clock::now();
      sample = &bench.exchange(
          {.tick = row.tick, .gates = v1::GATES_VOLTAGE, .u_a_v = output.u_a_v, .u_b_v = output.u_b_v});
      row.exchange_us = microseconds(Clock::now() - asked);
      if (run.rows.size() == 1 && !loads.empty()) {
        // Only now it is certain which tick was the first.
        schedule_loads(bench, preset, loads, row.tick);
        sample = &bench.newest();
      }
      periods = static_cast<std::int64_t>(sample->tick - row.tick);
      if (run.rows.size() % 64 == 0) {
        progress.update(static_cast<double>(run.rows.size()) / static_cast<double>(move.planned_samples()),
                        name_of(move.phase()));
      }
    }
  } catch (const link::Refused& refused) {
    run.failure = fmt::format("the bench refused: {}", refused.what());
    if (refused.code() == v1::REFUSAL_LATCHED) {
      const std::string latched = latched_text(bench.bench(), bench.newest());
      if (!latched.empty()) run.failure = "the bench latched " + latched;
    }
  } catch (const link::LinkError& error) {
    run.failure = error.what();  // the rows so far are not lost with it
  }
  run.wall_s = microseconds(Clock::now() - started) * 1e-6;
  return run;
}

ControlReport summary_of(const ServoRun& run, double period_s) {
  ControlReport report;
  report.failure = run.failure;
  if (!run.knows_angle) report.angle_source = "encoder";
  if (!run.knows_speed) report.speed_source = "observer";
  report.late_ticks = run.late_ticks;
  report.wall_s = run.wall_s;
  report.samples = static_cast<std::int64_t>(run.rows.size());
  if (run.rows.empty()) return report;

  std::vector<double> exchanges_us;
  exchanges_us.reserve(run.rows.size());
  double peak_voltage_v = 0.0;
  double final_error_counts = 0.0;
  for (std::size_t i = 0; i < run.rows.size(); ++i) {
    const ServoRow& row = run.rows[i];
    report.missed_ticks += row.periods - 1;
    report.peak_error_counts = larger(report.peak_error_counts, row.error_counts);
    report.peak_speed_rad_s = larger(report.peak_speed_rad_s, row.speed_rad_s);
    report.peak_current_a = larger(larger(report.peak_current_a, row.i_a_a), row.i_b_a);
    report.peak_command_voltage_v =
        larger(larger(report.peak_command_voltage_v, row.command_a_v), row.command_b_v);
    peak_voltage_v = larger(larger(peak_voltage_v, row.u_a_v), row.u_b_v);
    if (i + 100 >= run.rows.size()) {
      report.final_error_counts = larger(report.final_error_counts, row.measured_error_counts);
      final_error_counts = larger(final_error_counts, row.error_counts);
    }
    if (row.exchange_us > 0.0) exchanges_us.push_back(row.exchange_us);
  }
  if (run.knows_angle) report.final_true_error_counts = final_error_counts;
  if (run.knows_voltage) report.peak_voltage_v = peak_voltage_v;
  report.first_tick = run.rows.front().tick;
  report.duration_s = static_cast<double>(run.rows.back().tick + 1 - report.first_tick) * period_s;
  std::ranges::sort(exchanges_us);
  report.exchange_p50_us = quantile(exchanges_us, 0.50);
  report.exchange_p99_us = quantile(exchanges_us, 0.99);
  report.exchange_max_us = quantile(exchanges_us, 1.0);
  return report;
}

std::string to_csv(const std::vector<ServoRow>& rows) {
  std::string csv =
      "tick,time [s],reference [rad],angle [rad],error [counts],measured_error [counts],speed [rad/s],"
      "speed_observer [rad/s],speed_difference [rad/s],i_a [A],i_b [A],command_a [V],command_b [V],u_a "
      "[V],u_b [V],exchange [us]\n";
  for (const ServoRow& r : rows) {
    fmt::format_to(std::back_inserter(csv), "{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{:.3f}\n", r.tick,
                   r.time_s, r.reference_rad, r.angle_rad, r.error_counts, r.measured_error_counts,
                   r.speed_rad_s, r.speed_observer_rad_s, r.speed_difference_rad_s, r.i_a_a, r.i_b_a,
                   r.command_a_v, r.command_b_v, r.u_a_v, r.u_b_v, r.exchange_us);
  }
  return csv;
}

}  // namespace drivebench::command
