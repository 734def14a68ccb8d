#include "clients/command/control/control_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>
#include <numbers>
#include <thread>

#include "clients/command/common/session/session.hpp"
#include "clients/command/control/control_loop.hpp"

namespace drivebench::command {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t kField = 3;  // of TerminalValues

double larger(double peak, double value) noexcept {
  return std::max(peak, std::abs(value));
}

double larger_phase(double peak, const TerminalValues& x) noexcept {
  return larger(larger(larger(peak, x[0]), x[1]), x[2]);
}

double microseconds(Clock::duration duration) noexcept {
  return std::chrono::duration<double, std::micro>(duration).count();
}

/// The value below which this part of the sorted values lies.
double quantile(const std::vector<double>& sorted, double part) noexcept {
  if (sorted.empty()) return 0.0;
  return sorted[static_cast<std::size_t>(part * static_cast<double>(sorted.size() - 1))];
}

/// The tick k of the run is the bench's `first_tick` + k.
void schedule_loads(link::AxisLink& bench, const control::Run& run, const std::vector<LoadAt>& loads,
                    std::uint64_t first_tick) {
  for (const LoadAt& load : loads) {
    const double after_s = run.timing().prepare_s + load.after_s;
    const auto ticks = static_cast<std::uint64_t>(std::llround(after_s * run.timing().sample_rate_hz));
    bench.set_load({.load_nm = load.load_nm, .ramp_ticks = 0, .at_tick = first_tick + ticks});
  }
}

ControlRow row_of(const Sample& sample, const ControlRun& into, std::int64_t periods, double start_rad,
                  const control::Run& run, const control::Setpoint& setpoint) {
  const control::Controller& controller = run.controller();
  ControlRow row = {.tick = sample.tick, .periods = periods, .time_s = run.time_s()};
  row.reference = run.reference();
  row.encoder_count = sample.encoder_count;
  row.shaft_rad = into.knows_angle ? sample.angle_rad : 0.0;
  row.angle_rad = into.knows_angle ? sample.angle_rad - start_rad : controller.angle_rad();
  row.error_rad = row.reference.angle_rad - row.angle_rad;
  row.measured_error_rad = row.reference.angle_rad - controller.angle_rad();
  row.speed_observer_rad_s = controller.speed_rad_s();
  row.speed_rad_s = into.knows_speed ? sample.speed_rad_s : row.speed_observer_rad_s;
  row.current_a = {sample.i_a_a, sample.i_b_a, sample.i_c_a, sample.i_f_a};
  row.setpoint = terminal_values_of(setpoint);
  row.voltage_v = {sample.u_a_v, sample.u_b_v, sample.u_c_v, sample.u_f_v};
  row.saturated = controller.saturated();
  return row;
}

/// The reason why the run cannot continue with this sample; empty: it can.
std::string obstacle(const link::AxisLink& bench, const Sample& sample, const control::Measurement& m,
                     bool is_first) {
  if (interrupted()) return "interrupted";
  for (const double current_a : {m.i_a_a, m.i_b_a, m.i_c_a, m.i_f_a}) {
    if (!std::isfinite(current_a)) return fmt::format("the sample of tick {} has no currents", sample.tick);
  }
  const std::string latched = latched_text(bench.bench(), sample);
  // In lockstep the first sample is from before the faults were cleared.
  return latched.empty() || is_first ? "" : "the bench latched " + latched;
}

void append_telemetry(ControlRun& into, const control::Controller& controller) {
  const std::span<const double> values = controller.telemetry();
  into.telemetry.insert(into.telemetry.end(), values.begin(), values.end());
}

/// Keeps every sample of the loop; a link that breaks throws out of the loop, and the rows so far stay.
class RowKeeper final : public LoopWatcher {
 public:
  RowKeeper(link::AxisLink& bench, const control::Run& run, const std::vector<LoadAt>& loads,
            ControlRun& into, double slowness)
      : bench_(bench), run_(run), loads_(loads), into_(into), slowness_(slowness) {}

  Answer answering(const LoopStep& step) override {
    const Sample& sample = step.sample;
    if (into_.rows.empty()) {
      start_rad_ = sample.angle_rad;
      first_late_ = sample.late_ticks;
    }
    into_.late_ticks = sample.late_ticks - first_late_;
    if (run_.done()) {
      into_.missed_at_end = run_.planned_samples() - covered_;
      return Answer::kEnd;
    }
    covered_ += step.periods;
    into_.rows.push_back(row_of(sample, into_, step.periods, start_rad_, run_, step.setpoint));
    append_telemetry(into_, run_.controller());
    into_.failure = obstacle(bench_, sample, step.measured, into_.rows.size() == 1);
    if (!into_.failure.empty()) return Answer::kEnd;
    if (slowness_ > 0.0) wait_until_due(sample.tick - into_.rows.front().tick);
    asked_ = Clock::now();
    return Answer::kSend;
  }

  const Sample& answered(const Sample& next) override {
    ControlRow& row = into_.rows.back();
    row.exchange_us = microseconds(Clock::now() - asked_);
    if (into_.rows.size() % 64 == 0) {
      progress_.update(static_cast<double>(into_.rows.size()) / static_cast<double>(run_.planned_samples()),
                       name_of(run_.phase()));
    }
    if (into_.rows.size() != 1 || loads_.empty()) return next;
    // Only now it is certain which tick was the first.
    schedule_loads(bench_, run_, loads_, row.tick);
    return bench_.newest();
  }

 private:
  void wait_until_due(std::uint64_t ticks) const {
    const double after_s = slowness_ * static_cast<double>(ticks) / run_.timing().sample_rate_hz;
    std::this_thread::sleep_until(
        started_ + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(after_s)));
  }

  link::AxisLink& bench_;
  const control::Run& run_;
  const std::vector<LoadAt>& loads_;
  ControlRun& into_;
  double slowness_;
  Clock::time_point started_ = Clock::now();
  Progress progress_{"control"};
  double start_rad_ = 0.0;
  std::uint64_t first_late_ = 0;
  std::int64_t covered_ = 0;  // samples of the plan up to the newest row
  Clock::time_point asked_;
};

void add_to(ControlReport& report, const ControlRow& row) {
  report.missed_ticks += row.periods - 1;
  report.peak_error_rad = larger(report.peak_error_rad, row.error_rad);
  report.peak_speed_rad_s = larger(report.peak_speed_rad_s, row.speed_rad_s);
  report.peak_speed_error_rad_s =
      larger(report.peak_speed_error_rad_s, row.reference.speed_rad_s - row.speed_rad_s);
  report.peak_current_a = larger_phase(report.peak_current_a, row.current_a);
  report.peak_field_current_a = larger(report.peak_field_current_a, row.current_a[kField]);
  report.saturated_samples += row.saturated ? 1 : 0;
}

std::map<std::string, double> telemetry_peaks(const ControlRun& run) {
  std::map<std::string, double> peaks;
  const std::size_t columns = run.telemetry_names.size();
  for (std::size_t i = 0; i < run.telemetry.size(); ++i) {
    double& peak = peaks[run.telemetry_names[i % columns]];
    peak = larger(peak, run.telemetry[i]);
  }
  return peaks;
}

}  // namespace

TerminalValues terminal_values_of(const control::Setpoint& x) {
  return {x.a, x.b, x.c, x.field};
}

ControlRun run_over(link::AxisLink& bench, control::Run run, const std::vector<LoadAt>& loads,
                    double counts_per_revolution, double slowness) {
  ControlRun into;
  into.knows_angle = bench.knows("angle_rad");
  into.knows_speed = bench.knows("speed_rad_s");
  into.knows_voltage = bench.knows("u_a_v");
  into.quantity = run.controller().quantity();
  into.counts_per_rad = counts_per_revolution / (2.0 * std::numbers::pi);
  const std::span<const std::string_view> names = run.controller().telemetry_names();
  into.telemetry_names.assign(names.begin(), names.end());
  into.rows.reserve(static_cast<std::size_t>(run.planned_samples()));
  into.telemetry.reserve(into.rows.capacity() * names.size());
  const Clock::time_point started = Clock::now();
  try {
    RowKeeper keeper(bench, run, loads, into, slowness);
    control_loop(bench, run, keeper);
  } catch (const link::RefusalError& refused) {
    into.failure = fmt::format("the bench refused: {}", refused.what());
    if (refused.code() == v1::REFUSAL_LATCHED) {
      const std::string latched = latched_text(bench.bench(), bench.newest());
      if (!latched.empty()) into.failure = "the bench latched " + latched;
    }
  } catch (const link::LinkError& error) {
    into.failure = error.what();  // the rows so far are not lost with it
  }
  into.wall_s = microseconds(Clock::now() - started) * 1e-6;
  return into;
}

ControlReport summary_of(const ControlRun& run, double period_s) {
  ControlReport report;
  report.failure = run.failure;
  if (!run.knows_angle) report.angle_source = "encoder";
  if (!run.knows_speed) report.speed_source = "observer";
  report.late_ticks = run.late_ticks;
  report.wall_s = run.wall_s;
  report.samples = static_cast<std::int64_t>(run.rows.size());
  report.missed_ticks = run.missed_at_end;
  if (run.rows.empty()) return report;

  std::vector<double> exchanges_us;
  exchanges_us.reserve(run.rows.size());
  double peak_setpoint = 0.0;
  double peak_voltage_v = 0.0;
  double final_error_rad = 0.0;
  for (std::size_t i = 0; i < run.rows.size(); ++i) {
    const ControlRow& row = run.rows[i];
    add_to(report, row);
    peak_setpoint = larger_phase(peak_setpoint, row.setpoint);
    peak_voltage_v = larger_phase(peak_voltage_v, row.voltage_v);
    if (i + 100 >= run.rows.size()) {
      report.final_error_rad = larger(report.final_error_rad, row.measured_error_rad);
      final_error_rad = larger(final_error_rad, row.error_rad);
    }
    if (row.exchange_us > 0.0) exchanges_us.push_back(row.exchange_us);
  }
  if (run.counts_per_rad > 0.0) {
    report.peak_error_counts = report.peak_error_rad * run.counts_per_rad;
    report.final_error_counts = report.final_error_rad * run.counts_per_rad;
    if (run.knows_angle) report.final_true_error_counts = final_error_rad * run.counts_per_rad;
  }
  (run.quantity == control::Quantity::kVoltage ? report.peak_command_voltage_v
                                               : report.peak_command_current_a) = peak_setpoint;
  if (run.knows_voltage) report.peak_voltage_v = peak_voltage_v;
  report.peak_telemetry = telemetry_peaks(run);
  report.first_tick = run.rows.front().tick;
  report.duration_s = static_cast<double>(run.rows.back().tick + 1 - report.first_tick) * period_s;
  std::ranges::sort(exchanges_us);
  report.exchange_p50_us = quantile(exchanges_us, 0.50);
  report.exchange_p99_us = quantile(exchanges_us, 0.99);
  report.exchange_max_us = quantile(exchanges_us, 1.0);
  return report;
}

std::string to_csv(const ControlRun& run) {
  const bool voltage = run.quantity == control::Quantity::kVoltage;
  std::string csv =
      "tick,time_s,reference_rad [rad],moved_rad [rad],error_counts [counts],measured_error_counts [counts],"
      "error_rad [rad],reference_speed_rad_s [rad/s],speed_rad_s [rad/s],speed_observer_rad_s [rad/s],"
      "encoder_count [counts]";
  if (run.knows_angle) csv += ",angle_rad [rad]";
  const auto add = [&csv](std::string_view format) {
    for (const std::string_view terminal : {"a", "b", "c", "f"})
      csv += fmt::format(fmt::runtime(format), terminal);
  };
  add(",i_{}_a [A]");
  add(voltage ? ",command_{}_v [V]" : ",command_{}_a [A]");
  if (run.knows_voltage) add(",u_{}_v [V]");
  csv += ",saturated";
  for (const std::string& name : run.telemetry_names)
    csv += ",controller_" + name;
  csv += ",exchange_us [us]\n";
  for (std::size_t i = 0; i < run.rows.size(); ++i) {
    const ControlRow& r = run.rows[i];
    const auto out = std::back_inserter(csv);
    fmt::format_to(out, "{},{},{},{},{},{},{},{},{},{},{}", r.tick, r.time_s, r.reference.angle_rad,
                   r.angle_rad, r.error_rad * run.counts_per_rad, r.measured_error_rad * run.counts_per_rad,
                   r.error_rad, r.reference.speed_rad_s, r.speed_rad_s, r.speed_observer_rad_s,
                   r.encoder_count);
    if (run.knows_angle) fmt::format_to(out, ",{}", r.shaft_rad);
    fmt::format_to(out, ",{},{}", fmt::join(r.current_a, ","), fmt::join(r.setpoint, ","));
    if (run.knows_voltage) fmt::format_to(out, ",{}", fmt::join(r.voltage_v, ","));
    fmt::format_to(out, ",{}", r.saturated ? 1 : 0);
    const std::size_t columns = run.telemetry_names.size();
    for (std::size_t column = 0; column < columns; ++column)
      fmt::format_to(out, ",{}", run.telemetry[i * columns + column]);
    fmt::format_to(out, ",{:.3f}\n", r.exchange_us);
  }
  return csv;
}

}  // namespace drivebench::command
