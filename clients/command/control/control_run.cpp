#include "clients/command/control/control_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>
#include <span>
#include <thread>

#include "clients/command/common/session/session.hpp"
#include "clients/command/control/control_loop.hpp"

namespace drivebench::command {
namespace {

using Clock = std::chrono::steady_clock;

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
    into_.rows.push_back(reference::row_of(sample, into_, step.periods, start_rad_, run_, step.setpoint));
    append_telemetry(into_, run_.controller());
    into_.failure = interrupted()
                        ? "interrupted"
                        : reference::obstacle(bench_.bench(), sample, step.measured, into_.rows.size() == 1);
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

}  // namespace

ControlRun run_over(link::AxisLink& bench, control::Run run, const std::vector<LoadAt>& loads,
                    double counts_per_revolution, double slowness) {
  ControlRun into;
  static_cast<reference::RunFacts&>(into) = reference::facts_of(run, bench.known(), counts_per_revolution);
  into.rows.reserve(static_cast<std::size_t>(run.planned_samples()));
  into.telemetry.reserve(into.rows.capacity() * into.telemetry_names.size());
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
  reference::RunNumbers numbers(run, period_s);
  std::vector<double> exchanges_us;
  exchanges_us.reserve(run.rows.size());
  const std::span<const double> telemetry = run.telemetry;
  const std::size_t columns = run.telemetry_names.size();
  for (std::size_t i = 0; i < run.rows.size(); ++i) {
    numbers.add(run.rows[i], telemetry.subspan(i * columns, columns));
    if (run.rows[i].exchange_us > 0.0) exchanges_us.push_back(run.rows[i].exchange_us);
  }
  ControlReport report = numbers.report();
  report.failure = run.failure;
  report.late_ticks = run.late_ticks;
  report.wall_s = run.wall_s;
  report.missed_ticks += run.missed_at_end;
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
