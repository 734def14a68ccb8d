#include "clients/command/identify/track/track.hpp"

#include <fmt/core.h>

#include <array>
#include <chrono>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/output.hpp"
#include "clients/command/common/session/session.hpp"
#include "clients/command/identify/data/identify_data.hpp"
#include "clients/command/identify/data/identify_steps.hpp"
#include "clients/command/identify/track/track_report.hpp"
#include "clients/command/motor/motor_file.hpp"
#include "protocols/signals/catalogue.hpp"

namespace drivebench::command {
namespace {

using identification::KnownInductances;
using identification::MotorKind;
using identification::ResistanceTracker;
using identification::Settings;
using namespace std::chrono_literals;

double leakage_of(double stator_h, double rotor_h, double mutual_h) {
  return 1.0 - mutual_h * mutual_h / (stator_h * rotor_h);
}

/// The inductances of the command line, of --motor-file, or of the bench, in this order.
KnownInductances known_inductances(const TrackOptions& o, const MeasuredMotor& m) {
  KnownInductances known;
  const auto value = [&m](const char* name) {
    const auto found = m.bench.find(name);
    return found == m.bench.end() ? 0.0 : found->second;
  };
  if (!o.motor_file.empty()) {
    const auto& motor = read_induction_motor(o.motor_file).motor;
    known = {.stator_inductance_h = motor.stator_inductance_h,
             .leakage_factor = leakage_of(motor.stator_inductance_h, motor.machine.rotor_inductance_h,
                                          motor.machine.mutual_inductance_h)};
  } else if (value("machine.stator_inductance_h") > 0.0 && value("machine.rotor_inductance_h") > 0.0) {
    const double stator_h = value("machine.stator_inductance_h");
    known = {.stator_inductance_h = stator_h,
             .leakage_factor = leakage_of(stator_h, value("machine.rotor_inductance_h"),
                                          value("machine.mutual_inductance_h"))};
  }
  if (o.stator_inductance_h) known.stator_inductance_h = *o.stator_inductance_h;
  if (o.leakage) known.leakage_factor = *o.leakage;
  if (!(known.stator_inductance_h > 0.0 && known.leakage_factor > 0.0))
    throw UsageError(
        "the inductances are not known: --motor-file, or --stator-inductance and --leakage, tell them");
  return known;
}

Settings settings_of_tracking(const TrackOptions& o, const MeasuredMotor& m, double period_s) {
  Settings e = settings_of(MotorKind::kInduction, m.facts, period_s);
  const double shift = m.drive.empty() ? 0.0 : e.processing.voltage_shift;  // without a drive that of a line
  e.processing = identification::tracking_processing(o.cutoff_hz, period_s, shift);
  if (m.bench.empty() && m.data.find("encoder_count") == nullptr) e.counts_per_revolution = 0.0;
  apply_options(o.data, e);
  return e;
}

ResistanceTracker tracker_of(const TrackOptions& o, const Settings& e, const KnownInductances& known,
                             double period_s) {
  const auto samples = [period_s](double time_s) {
    return static_cast<std::size_t>(std::max(1.0, std::round(time_s / period_s)));
  };
  return ResistanceTracker({.settings = e,
                            .known = known,
                            .period_s = period_s,
                            .window = samples(o.window_s),
                            .stride = samples(o.stride_s)});
}

/// The middle of the window that ends now; the filters see the edges beyond it.
double middle_s(double now_s, const TrackOptions& o, const Settings& e, double period_s) {
  return now_s - 0.5 * o.window_s - static_cast<double>(e.processing.edge_samples) * period_s;
}

/// The samples of a running axis.
class LiveTracking {
 public:
  LiveTracking(const TrackOptions& options, TrackReport& report)
      : options_(options), report_(report), link_(open_link(options.data.server.link, "track")) {
    const v1::BenchDescription& bench = link_.welcome().bench();
    axis_ = axis_number(bench, options.data.axis.empty() ? "0" : options.data.axis);
    const v1::AxisDescription& axis = bench.axes(static_cast<int>(axis_));
    if (axis.machine_kind() != "induction")
      throw UsageError(fmt::format("axis {} of the bench {} is of kind {}; tracking is for induction",
                                   axis.name(), bench.name(), axis.machine_kind()));
    take_description(bench, axis_, {}, motor_);
    period_s_ = bench.period_s();
    settings_ = settings_of_tracking(options, motor_, period_s_);
    known_ = known_inductances(options, motor_);
    source_ = fmt::format("axis {} of the bench {}", axis.name(), bench.name());
  }

  const std::string& source() const noexcept { return source_; }

  void run() {
    report_.heading(source_, known_, options_.window_s);
    ResistanceTracker tracker = tracker_of(options_, settings_, known_, period_s_);
    link_.subscribe(axis_, 1, names());
    truths_.push_back(truth_at(0.0));
    for (bool waiting = false; !interrupted();) {
      const std::optional<v1::Samples> samples = link_.next_samples(1000ms);
      if (!samples) {
        if (!waiting) fmt::print(stderr, "track: the bench sends no samples; waiting\n");
        waiting = true;
        continue;
      }
      waiting = false;
      for (const v1::Sample& message : samples->samples()) {
        if (!take(plain(message), tracker)) return;
      }
    }
  }

 private:
  std::vector<std::string> names() const {
    std::vector<std::string> names = {"tick", "i_a_a", "i_b_a", "u_a_v", "u_b_v"};
    if (settings_.three_phase) names.insert(names.end(), {"i_c_a", "u_c_v"});
    names.emplace_back(settings_.counts_per_revolution > 0.0 ? "encoder_count" : "angle_rad");
    return names;
  }

  /// Returns whether the tracking goes on.
  bool take(const Sample& s, ResistanceTracker& tracker) {
    const double now_s = static_cast<double>(s.tick) * period_s_;
    if (!first_s_) first_s_ = now_s;
    if (last_tick_ && s.tick != *last_tick_ + 1) {
      tracker.restart();
      report_.gap(s.tick - *last_tick_ - 1, now_s);
    }
    last_tick_ = s.tick;
    const double shaft =
        settings_.counts_per_revolution > 0.0 ? static_cast<double>(s.encoder_count) : s.angle_rad;
    const auto found = tracker.push({s.i_a_a, s.i_b_a, s.i_c_a, s.u_a_v, s.u_b_v, s.u_c_v, shaft});
    if (found) {
      truths_.push_back(truth_at(now_s));
      const double time_s = middle_s(now_s, options_, settings_, period_s_);
      report_.add({.time_s = time_s, .estimate = *found, .truth = truth_between(time_s)});
    }
    return options_.duration_s == 0.0 || now_s - *first_s_ < options_.duration_s;
  }

  TrackTruth truth_at(double time_s) {
    static const std::array<std::string, 3> kNames = {
        "machine.stator_resistance_ohm", "machine.rotor_resistance_ohm", "machine.rotor_inductance_h"};
    const v1::ParameterValues& values = link_.read_parameters(axis_, kNames);
    return {.time_s = time_s,
            .stator_resistance_ohm = values.parameters(0).value(),
            .rotor_time_constant_s = values.parameters(2).value() / values.parameters(1).value()};
  }

  /// The truth at a time between two that were read.
  TrackTruth truth_between(double time_s) const {
    for (std::size_t k = truths_.size() - 1; k > 0; --k) {
      const TrackTruth& from = truths_[k - 1];
      const TrackTruth& to = truths_[k];
      if (from.time_s > time_s || to.time_s <= from.time_s) continue;
      const double part = std::clamp((time_s - from.time_s) / (to.time_s - from.time_s), 0.0, 1.0);
      return {.time_s = time_s,
              .stator_resistance_ohm = std::lerp(from.stator_resistance_ohm, to.stator_resistance_ohm, part),
              .rotor_time_constant_s = std::lerp(from.rotor_time_constant_s, to.rotor_time_constant_s, part)};
    }
    return truths_.front();
  }

  const TrackOptions& options_;
  TrackReport& report_;
  link::Link link_;
  std::uint32_t axis_ = 0;
  MeasuredMotor motor_;
  double period_s_ = 0.0;
  Settings settings_;
  KnownInductances known_;
  std::string source_;
  std::optional<double> first_s_;
  std::optional<std::uint64_t> last_tick_;
  std::vector<TrackTruth> truths_;
};

/// A recording or a CSV file, sample by sample as if it ran. Returns its description.
std::string track_file(const TrackOptions& o, TrackReport& report) {
  const MeasuredMotor m = read_measurement(o.data, *identification::find_motor("im"));
  const Settings e = settings_of_tracking(o, m, m.data.period_s);
  const bool counts = m.data.find("encoder_count") != nullptr;
  if (counts && !(e.counts_per_revolution > 0.0) && m.data.find("angle_rad") == nullptr)
    throw UsageError("--counts is missing: how many counts of encoder_count are a revolution");
  if (m.bench.empty() && !o.data.pole_pairs) throw UsageError("--pole-pairs is missing");
  const KnownInductances known = known_inductances(o, m);
  report.heading(m.source, known, o.window_s);
  ResistanceTracker tracker = tracker_of(o, e, known, m.data.period_s);
  const char* shaft = e.counts_per_revolution > 0.0 ? "encoder_count" : "angle_rad";
  const std::array columns = {m.data.at("i_a_a"), m.data.at("i_b_a"), m.data.at("u_a_v"), m.data.at("u_b_v"),
                              m.data.at(shaft)};
  const identification::Series none(e.three_phase ? 0 : m.data.samples(), 0.0);
  const identification::SeriesView i_c =
      e.three_phase ? m.data.at("i_c_a") : identification::SeriesView(none);
  const identification::SeriesView u_c =
      e.three_phase ? m.data.at("u_c_v") : identification::SeriesView(none);
  for (std::size_t k = 0; k < m.data.samples() && !interrupted(); ++k) {
    const double now_s = static_cast<double>(k) * m.data.period_s;
    if (o.duration_s > 0.0 && now_s > o.duration_s) break;
    const auto found = tracker.push(
        {columns[0][k], columns[1][k], i_c[k], columns[2][k], columns[3][k], u_c[k], columns[4][k]});
    if (found)
      report.add({.time_s = middle_s(now_s, o, e, m.data.period_s), .estimate = *found, .truth = {}});
  }
  return m.source;
}

}  // namespace

int run_track(const TrackOptions& options) {
  catch_interrupts();
  TrackReport report(options.json);
  std::string source;
  try {
    if (options.data.from_file.empty()) {
      LiveTracking live(options, report);
      live.run();
      source = live.source();
    } else {
      source = track_file(options, report);
    }
  } catch (const identification::IdentificationError& error) {
    throw UsageError(error.what());
  }
  if (!options.plot_file.empty()) {
    if (report.rows() == 0) throw std::runtime_error("no picture: there is no estimate");
    Output out(options.plot_file);
    out.write(report.plot(source));
    out.flush();
  }
  if (!report.has_stated()) fmt::print(stderr, "track: no resistance could be told\n");
  return report.has_stated() ? kExitOk : kExitFailed;
}

}  // namespace drivebench::command
