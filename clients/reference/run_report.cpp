#include "clients/reference/run_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "clients/reference/answers.hpp"
#include "clients/reference/fault_text.hpp"
#include "protocols/number_text.hpp"
#include "protocols/signals/unit_suffix.hpp"

namespace drivebench::reference {
namespace {

constexpr std::size_t kField = 3;  // of TerminalValues

double larger(double peak, double value) noexcept {
  return std::max(peak, std::abs(value));
}

double larger_phase(double peak, const TerminalValues& x) noexcept {
  return larger(larger(larger(peak, x[0]), x[1]), x[2]);
}

}  // namespace

TerminalValues terminal_values_of(const control::Setpoint& x) {
  return {x.a, x.b, x.c, x.field};
}

RunFacts facts_of(const control::Run& run, SignalMask known, double counts_per_revolution) {
  const std::span<const std::string_view> names = run.controller().telemetry_names();
  return {.knows_angle = (known & bit_of("angle_rad")) != 0,
          .knows_speed = (known & bit_of("speed_rad_s")) != 0,
          .knows_voltage = (known & bit_of("u_a_v")) != 0,
          .quantity = run.controller().quantity(),
          .counts_per_rad = counts_per_revolution / (2.0 * std::numbers::pi),
          .telemetry_names = {names.begin(), names.end()}};
}

ControlRow row_of(const Sample& sample, const RunFacts& facts, std::int64_t periods, double start_rad,
                  const control::Run& run, const control::Setpoint& setpoint) {
  const control::Controller& controller = run.controller();
  ControlRow row = {.tick = sample.tick, .periods = periods, .time_s = run.time_s()};
  row.reference = run.reference();
  row.encoder_count = sample.encoder_count;
  row.shaft_rad = facts.knows_angle ? sample.angle_rad : 0.0;
  row.angle_rad = facts.knows_angle ? sample.angle_rad - start_rad : controller.angle_rad();
  row.error_rad = row.reference.angle_rad - row.angle_rad;
  row.measured_error_rad = row.reference.angle_rad - controller.angle_rad();
  row.speed_observer_rad_s = controller.speed_rad_s();
  row.speed_rad_s = facts.knows_speed ? sample.speed_rad_s : row.speed_observer_rad_s;
  row.current_a = {sample.i_a_a, sample.i_b_a, sample.i_c_a, sample.i_f_a};
  row.setpoint = terminal_values_of(setpoint);
  row.voltage_v = {sample.u_a_v, sample.u_b_v, sample.u_c_v, sample.u_f_v};
  row.saturated = controller.saturated();
  return row;
}

std::string obstacle(const v1::BenchDescription& bench, const Sample& sample, const control::Measurement& m,
                     bool is_first) {
  for (const double current_a : {m.i_a_a, m.i_b_a, m.i_c_a, m.i_f_a}) {
    if (!std::isfinite(current_a)) return fmt::format("the sample of tick {} has no currents", sample.tick);
  }
  const std::string latched = latched_text(bench, sample);
  // In lockstep the first sample is from before the faults were cleared.
  return latched.empty() || is_first ? "" : "the bench latched " + latched;
}

RunNumbers::RunNumbers(const RunFacts& facts, double period_s)
    : facts_(facts), period_s_(period_s), peak_telemetry_(facts.telemetry_names.size()) {
  if (!facts.knows_angle) report_.angle_source = "encoder";
  if (!facts.knows_speed) report_.speed_source = "observer";
}

void RunNumbers::add(const ControlRow& row, std::span<const double> telemetry) {
  if (report_.samples == 0) report_.first_tick = row.tick;
  last_tick_ = row.tick;
  last_[static_cast<std::size_t>(report_.samples) % kLast] = {.measured_rad = row.measured_error_rad,
                                                              .error_rad = row.error_rad};
  ++report_.samples;
  report_.missed_ticks += row.periods - 1;
  report_.peak_error_rad = larger(report_.peak_error_rad, row.error_rad);
  report_.peak_speed_rad_s = larger(report_.peak_speed_rad_s, row.speed_rad_s);
  report_.peak_speed_error_rad_s =
      larger(report_.peak_speed_error_rad_s, row.reference.speed_rad_s - row.speed_rad_s);
  report_.peak_current_a = larger_phase(report_.peak_current_a, row.current_a);
  report_.peak_field_current_a = larger(report_.peak_field_current_a, row.current_a[kField]);
  report_.saturated_samples += row.saturated ? 1 : 0;
  peak_setpoint_ = larger_phase(peak_setpoint_, row.setpoint);
  peak_voltage_v_ = larger_phase(peak_voltage_v_, row.voltage_v);
  for (std::size_t i = 0; i < peak_telemetry_.size(); ++i)
    peak_telemetry_[i] = larger(peak_telemetry_[i], telemetry[i]);
}

ControlReport RunNumbers::report() const {
  ControlReport report = report_;
  if (report.samples == 0) return report;
  double final_error_rad = 0.0;
  for (const Errors& each : last_) {
    report.final_error_rad = larger(report.final_error_rad, each.measured_rad);
    final_error_rad = larger(final_error_rad, each.error_rad);
  }
  if (facts_.counts_per_rad > 0.0) {
    report.peak_error_counts = report.peak_error_rad * facts_.counts_per_rad;
    report.final_error_counts = report.final_error_rad * facts_.counts_per_rad;
    if (facts_.knows_angle) report.final_true_error_counts = final_error_rad * facts_.counts_per_rad;
  }
  (facts_.quantity == control::Quantity::kVoltage ? report.peak_command_voltage_v
                                                  : report.peak_command_current_a) = peak_setpoint_;
  if (facts_.knows_voltage) report.peak_voltage_v = peak_voltage_v_;
  for (std::size_t i = 0; i < peak_telemetry_.size(); ++i)
    report.peak_telemetry[facts_.telemetry_names[i]] = peak_telemetry_[i];
  report.duration_s = static_cast<double>(last_tick_ + 1 - report.first_tick) * period_s_;
  return report;
}

std::vector<ReportRow> rows_of(const ControlReport& r) {
  std::vector<ReportRow> rows;
  const auto row = [&rows](std::string name, double value, std::string_view unit) {
    rows.push_back({.name = std::move(name), .value = number_text(value), .unit = std::string(unit)});
  };
  const auto known = [&row](std::string_view name, std::optional<double> value, std::string_view unit) {
    if (value) row(std::string(name), *value, unit);
  };
  const auto counted = [&rows](std::string name, auto value) {
    rows.push_back({.name = std::move(name), .value = fmt::format("{}", value), .unit = ""});
  };
  const bool is_truth = r.angle_source == "truth";
  known(is_truth ? "peak error (true angle)" : "peak error (encoder)", r.peak_error_counts, "counts");
  row("peak error", r.peak_error_rad, "rad");
  known("final error (encoder)", r.final_error_counts, "counts");
  known("final error (true angle)", r.final_true_error_counts, "counts");
  row(r.speed_source == "truth" ? "peak speed" : "peak speed (observer)", r.peak_speed_rad_s, "rad/s");
  row("peak speed error", r.peak_speed_error_rad_s, "rad/s");
  row("peak phase current", r.peak_current_a, "A");
  if (r.peak_field_current_a > 0.0) row("peak field current", r.peak_field_current_a, "A");
  known("peak phase voltage, asked for", r.peak_command_voltage_v, "V");
  known("peak phase current, asked for", r.peak_command_current_a, "A");
  known("peak phase voltage, applied", r.peak_voltage_v, "V");
  counted("samples at a limit", r.saturated_samples);
  for (const auto& [telemetry, value] : r.peak_telemetry) {
    const NameWithUnit parts = split_unit(telemetry);
    row(fmt::format("peak {}", parts.name), value, parts.unit);
  }
  row("duration", r.duration_s * 1e3, "ms of the bench's time");
  if (r.wall_s > 0.0) row("wall time", r.wall_s * 1e3, "ms");
  counted("samples", r.samples);
  counted("samples missed here", r.missed_ticks);
  counted("late ticks of the bench", r.late_ticks);
  if (r.exchange_max_us == 0.0) return rows;
  const char* what = r.mode == "realtime" ? "us, the wait for the next tick included" : "us";
  row("exchange p50", r.exchange_p50_us, what);
  row("exchange p99", r.exchange_p99_us, what);
  row("exchange max", r.exchange_max_us, what);
  return rows;
}

}  // namespace drivebench::reference
