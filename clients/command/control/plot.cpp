#include "clients/command/control/plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <optional>
#include <span>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/output.hpp"
#include "clients/command/common/basics/signals.hpp"
#include "clients/command/control/control_presets.hpp"
#include "clients/command/control/control_replay.hpp"
#include "clients/command/recording/recorded_run.hpp"
#include "clients/command/recording/svg_plot.hpp"
#include "clients/control/loop/run.hpp"
#include "clients/reference/preset_fit.hpp"
#include "protocols/mcap/time_base.hpp"
#include "protocols/nearest_name.hpp"
#include "protocols/signals/unit_suffix.hpp"
#include "protocols/text.hpp"

namespace drivebench::command {
namespace {

/// The plan of a recorded run, sample by sample; empty without a preset.
struct Plan {
  std::vector<control::Reference> references;
  double counts_per_rad = 0.0;  ///< 0: unknown
};

/// What the preset's controller makes of the recorded samples.
struct Estimates {
  std::vector<double> speed_rad_s;
  std::vector<double> flux_wb;  ///< empty: the controller has no such estimate
  std::vector<double> load_nm;  ///< likewise
  std::map<std::string, std::vector<double>, std::less<>> telemetry;  ///< by its names
};

std::vector<double> column(const RecordedRun& run, const std::function<double(const Answered&)>& value) {
  std::vector<double> values;
  values.reserve(run.rows.size());
  for (const Answered& row : run.rows)
    values.push_back(value(row));
  return values;
}

std::vector<double> column(const Plan& plan, double control::Reference::*member) {
  std::vector<double> values;
  values.reserve(plan.references.size());
  for (const control::Reference& reference : plan.references)
    values.push_back(reference.*member);
  return values;
}

/// The lines that are not zero throughout.
Panel panel_of(std::string label, std::vector<PlotLine> lines) {
  std::erase_if(lines, [](const PlotLine& each) {
    return std::ranges::all_of(each.values, [](double value) { return value == 0.0; });
  });
  return {.label = std::move(label), .lines = std::move(lines)};
}

Panel with_reference(std::string label, const std::string& name, std::vector<double> values, const Plan& plan,
                     double control::Reference::*member) {
  Panel panel = {.label = std::move(label), .lines = {}};
  if (!plan.references.empty()) panel.lines.push_back({"reference", column(plan, member)});
  panel.lines.push_back({name, std::move(values)});
  return panel;
}

Panel error_panel(const RecordedRun& run, const Plan& plan) {
  const bool in_counts = plan.counts_per_rad > 0.0;
  const double factor = in_counts ? plan.counts_per_rad : 1.0;
  std::vector<double> errors;
  for (std::size_t i = 0; i < plan.references.size(); ++i) {
    const double angle_rad = run.rows[i].sample.angle_rad - run.rows[0].sample.angle_rad;
    errors.push_back(factor * (plan.references[i].angle_rad - angle_rad));
  }
  return {.label = in_counts ? "error [counts]" : "error [rad]", .lines = {{"error", std::move(errors)}}};
}

/// Phases a, b and c and the field winding.
Panel terminals(const RecordedRun& run, std::string label, char quantity,
                const std::array<double Sample::*, 4>& members) {
  std::vector<PlotLine> lines;
  for (std::size_t k = 0; k < members.size(); ++k) {
    lines.push_back({fmt::format("{}_{}", quantity, "abcf"[k]),
                     column(run, [&](const Answered& row) { return row.sample.*members[k]; })});
  }
  return panel_of(std::move(label), std::move(lines));
}

Panel with_estimate(std::string label, const std::string& name, std::vector<double> values,
                    const std::vector<double>& estimate) {
  Panel panel = {.label = std::move(label), .lines = {{name, std::move(values)}}};
  if (!estimate.empty()) panel.lines.push_back({"estimate", estimate});
  return panel;
}

/// The panels of recorded values.
constexpr std::array<std::string_view, 6> kPlainPanels = {"angle",    "speed",    "error",
                                                          "currents", "voltages", "torque"};
/// The panels that show estimates beside the truth. Every value of the controller's telemetry is a panel,
/// too.
constexpr std::array<std::string_view, 3> kEstimatePanels = {"speed-estimate", "flux", "load"};

Panel estimate_panel(std::string_view name, const RecordedRun& run, const Estimates& estimates) {
  if (name == "speed-estimate") {
    return with_estimate("speed [rad/s]", "speed",
                         column(run, [](const Answered& row) { return row.sample.speed_rad_s; }),
                         estimates.speed_rad_s);
  }
  if (name == "flux") {
    return with_estimate(
        "rotor flux [Wb]", "flux",
        column(run, [](const Answered& row) { return std::hypot(row.sample.psi_a_wb, row.sample.psi_b_wb); }),
        estimates.flux_wb);
  }
  return with_estimate("load [N*m]", "load",
                       column(run, [](const Answered& row) { return row.sample.load_nm; }),
                       estimates.load_nm);
}

Panel panel_named(std::string_view name, const RecordedRun& run, const Plan& plan,
                  const Estimates& estimates) {
  if (name == "angle") {
    const double start_rad = run.rows.front().sample.angle_rad;
    return with_reference(
        "angle [rad]", "angle",
        column(run, [start_rad](const Answered& row) { return row.sample.angle_rad - start_rad; }), plan,
        &control::Reference::angle_rad);
  }
  if (name == "speed") {
    return with_reference("speed [rad/s]", "speed",
                          column(run, [](const Answered& row) { return row.sample.speed_rad_s; }), plan,
                          &control::Reference::speed_rad_s);
  }
  if (name == "error") return error_panel(run, plan);
  if (name == "currents") {
    return terminals(run, "current [A]", 'i',
                     {&Sample::i_a_a, &Sample::i_b_a, &Sample::i_c_a, &Sample::i_f_a});
  }
  if (name == "voltages") {
    return terminals(run, "voltage [V]", 'u',
                     {&Sample::u_a_v, &Sample::u_b_v, &Sample::u_c_v, &Sample::u_f_v});
  }
  if (name == "torque") {
    return panel_of("torque [N*m]",
                    {{"machine", column(run, [](const Answered& row) { return row.sample.torque_nm; })},
                     {"load", column(run, [](const Answered& row) { return row.sample.load_nm; })}});
  }
  if (std::ranges::count(kEstimatePanels, name) != 0) return estimate_panel(name, run, estimates);
  if (const auto found = estimates.telemetry.find(name); found != estimates.telemetry.end()) {
    return {.label = axis_title(name, split_unit(name).unit.empty() ? "1" : split_unit(name).unit),
            .lines = {{"controller", found->second}}};
  }
  std::vector<std::string> known(kPlainPanels.begin(), kPlainPanels.end());
  known.insert(known.end(), kEstimatePanels.begin(), kEstimatePanels.end());
  for (const auto& [telemetry, values] : estimates.telemetry)
    known.push_back(telemetry);
  throw UsageError(fmt::format("no panel '{}'{}; there are {}", printable(name), did_you_mean(name, known),
                               fmt::join(known, ", ")));
}

/// The trajectory over the recorded samples; the recording is cut where the run has ended.
Plan planned(const PlotOptions& options, RecordedRun& recorded, double& start_s) {
  Plan plan;
  if (options.preset.empty()) return plan;
  const control::Preset& preset = chosen_preset(options.preset);
  const control::Run run = made(preset, options.overrides);
  start_s = run.timing().prepare_s;
  plan.counts_per_rad =
      reference::needs_of(preset, options.overrides).counts_per_revolution / (2.0 * std::numbers::pi);
  const std::uint64_t first = recorded.rows.front().sample.tick;
  std::erase_if(recorded.rows, [&](const Answered& row) {
    return static_cast<std::int64_t>(row.sample.tick - first) >= run.planned_samples();
  });
  for (const Answered& row : recorded.rows) {
    const double t_s = static_cast<double>(row.sample.tick - first) * recorded.period_s;
    plan.references.push_back(run.trajectory().at(t_s - start_s));
  }
  return plan;
}

Estimates estimated(const PlotOptions& options, const RecordedRun& recorded) {
  control::Run run = made(chosen_preset(options.preset), options.overrides);
  const auto names = run.controller().telemetry_names();
  const auto column_of = [&](std::string_view name) {
    return static_cast<std::size_t>(std::ranges::find(names, name) - names.begin());
  };
  const std::size_t flux = column_of("flux_wb");
  const std::size_t load = column_of("load_nm");
  Estimates out;
  answer_recorded(recorded, run, [&](const Answered&, const control::Setpoint&) {
    const std::span<const double> values = run.controller().telemetry();
    out.speed_rad_s.push_back(run.controller().speed_rad_s());
    if (flux < values.size()) out.flux_wb.push_back(values[flux]);
    if (load < values.size()) out.load_nm.push_back(values[load]);
    for (std::size_t i = 0; i < values.size(); ++i)
      out.telemetry[std::string(names[i])].push_back(values[i]);
  });
  return out;
}

/// Of a panel whose curves have names of their own.
std::string unit_title(std::string_view unit) {
  return unit == "1" || unit == "enum" || unit == "bits" ? "number" : fmt::format("[{}]", unit);
}

/// Whether a panel needs the estimates; refuses panels that need a preset where there is none.
bool needs_estimates(const std::vector<std::string>& names, bool has_preset) {
  bool found = false;
  for (const std::string& name : names) {
    const bool is_estimate = std::ranges::count(kEstimatePanels, name) != 0;
    if (!has_preset && (is_estimate || name == "error"))
      throw UsageError(fmt::format("the panel {} needs --preset", name));
    found |= has_preset && std::ranges::count(kPlainPanels, name) == 0;
  }
  return found;
}

/// A panel for each unit, in the order of the names. One of a single signal has its name.
std::vector<Panel> panels_of_signals(const std::vector<std::string>& names, const RecordedRun& run) {
  std::vector<std::vector<const Signal*>> groups;
  for (const Signal* signal : signals_named(names)) {
    const auto group = std::ranges::find(groups, signal->unit, [](const auto& of) { return of[0]->unit; });
    if (group == groups.end()) {
      groups.push_back({signal});
    } else if (std::ranges::count(*group, signal) == 0) {
      group->push_back(signal);
    }
  }
  std::vector<Panel> panels;
  for (const std::vector<const Signal*>& group : groups) {
    const Signal& first = *group.front();
    Panel panel{.label = group.size() == 1 ? axis_title(first.name, first.unit) : unit_title(first.unit),
                .lines = {}};
    for (const Signal* signal : group)
      panel.lines.push_back(
          {std::string(split_unit(signal->name).name),
           column(run, [&](const Answered& row) { return value_of(*signal, row.sample); })});
    panels.push_back(std::move(panel));
  }
  return panels;
}

std::vector<Panel> panels_of(const PlotOptions& options, const RecordedRun& recorded, const Plan& plan) {
  if (!options.signals.empty()) return panels_of_signals(options.signals, recorded);
  std::vector<std::string> names = options.panels;
  if (names.empty()) names = {"speed", "currents", "voltages"};
  if (options.panels.empty() && !plan.references.empty()) names.insert(names.begin() + 1, "error");
  Estimates estimates;
  if (needs_estimates(names, !plan.references.empty())) estimates = estimated(options, recorded);
  std::vector<Panel> panels;
  panels.reserve(names.size());
  for (const std::string& name : names)
    panels.push_back(panel_named(name, recorded, plan, estimates));
  return panels;
}

/// In real time it says when time 0 was, so that the plot can be held against other logs of that hour.
std::string time_label(const RecordedRun& run, double start_s) {
  if (!run.is_real_time) return "time [ms]";
  return "time [ms] since " + utc_text(run.rows.front().due_unix_ns + std::llround(start_s * 1e9));
}

}  // namespace

int run_plot(const PlotOptions& options) {
  signals_named(options.signals);  // reports a wrong name before it reads a file
  RecordedRun recorded = options.preset.empty()
                             ? read_samples(options.recording, options.axis, options.from_tick)
                             : read_run(options.recording, options.axis, options.from_tick);
  double start_s = 0.0;
  const Plan plan = planned(options, recorded, start_s);
  const std::vector<Panel> panels = panels_of(options, recorded, plan);
  const std::uint64_t first = recorded.rows.front().sample.tick;
  const std::vector<double> times_ms = column(recorded, [&](const Answered& row) {
    return 1e3 * (static_cast<double>(row.sample.tick - first) * recorded.period_s - start_s);
  });
  const std::string title = !options.title.empty()   ? options.title
                            : options.preset.empty() ? options.recording
                                                     : options.preset;
  Output out(options.out_file);
  out.write(svg_of(title, time_label(recorded, start_s), times_ms, panels));
  out.flush();
  return kExitOk;
}

}  // namespace drivebench::command
