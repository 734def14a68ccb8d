#include "clients/command/identify/identify_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>
#include <vector>

#include "clients/command/recording/svg_plot.hpp"
#include "protocols/signals/unit_suffix.hpp"

namespace drivebench::command {
namespace {

using identification::Estimate;
using identification::LoadModel;
using identification::LowPass;
using identification::MotorKind;
using identification::Processing;
using identification::Resimulated;
using identification::Result;

std::string filter_text(const LowPass& filter) {
  return filter.cutoff_hz > 0.0 ? fmt::format("{:g} Hz", filter.cutoff_hz) : std::string("none");
}

/// The settings of the identification as text, for the reader of the table below.
std::string settings_text(const IdentifyReport& r) {
  const Processing& p = r.settings.processing;
  std::string text = fmt::format(
      "{} samples of {:g} us; pole pairs {}; shaft from {}; voltages advanced by {:g} samples",
      r.result.samples, 1e6 * r.period_s, r.settings.pole_pairs,
      r.settings.counts_per_revolution > 0.0 ? fmt::format("{:g} counts", r.settings.counts_per_revolution)
                                             : std::string("angle_rad"),
      p.voltage_shift);
  text += fmt::format("; filters of order {}: currents {}, voltages {}, shaft {}", p.current.order,
                      filter_text(p.current), filter_text(p.voltage), filter_text(p.shaft));
  if (p.shaft_chosen)
    text += r.settings.kind == MotorKind::kDc ? " (chosen from counts, rate and motion)"
                                              : " (that of the shaft chosen from counts, rate and motion)";
  if (r.settings.kind == MotorKind::kInduction)
    text += r.settings.load == LoadModel::kConstant ? "; constant load torque" : "; viscous friction";
  return text;
}

std::string fit_text(const Resimulated& signal) {
  if (!std::isfinite(signal.normalised))
    return fmt::format("{} {:.3g} {}", signal.name, signal.rms_error, signal.unit);
  return fmt::format("{} {:.3g} {} ({:.2f} %)", signal.name, signal.rms_error, signal.unit,
                     100.0 * signal.normalised);
}

std::string validation_text(const IdentifyReport& r) {
  if (!r.validation) return r.validation_problem;
  std::string text;
  for (const Resimulated& signal : r.validation->signals)
    text += (text.empty() ? "" : ", ") + fit_text(signal);
  return fmt::format("rms error of the motor found on the measured voltages, from {}: {}",
                     r.validation->from_rest ? "standstill" : "the measured state", text);
}

/// Adds measured less re-simulated to the panel of its unit.
void add_residual(std::vector<Panel>& panels, const Resimulated& signal) {
  const std::string label = fmt::format("residual [{}]", signal.unit);
  PlotLine line{.name = std::string(split_unit(signal.name).name), .values = {}};
  for (std::size_t k = 0; k < signal.measured.size(); ++k)
    line.values.push_back(signal.measured[k] - signal.simulated[k]);
  auto panel = std::ranges::find(panels, label, &Panel::label);
  if (panel == panels.end()) panel = panels.insert(panel, {.label = label, .lines = {}});
  panel->lines.push_back(std::move(line));
}

const char* inside_text(const Result& result, const Estimate& e) {
  const std::optional<bool> inside = is_inside(result, e);
  const bool refined = e.interval.has_value();
  if (!inside) return "";
  if (*inside) return refined ? "inside" : "inside the index";
  return refined ? "outside" : "outside the index";
}

}  // namespace

std::string identify_text(const IdentifyReport& r) {
  const Result& result = r.result;
  std::string text = fmt::format("{}\n{}\n{}\n\n", result.method, r.source, settings_text(r));
  auto out = std::back_inserter(text);
  std::size_t width = 6;
  for (const Estimate& e : result.parameters)
    width = std::max(width, e.name.size());
  constexpr const char* kRow = "  {:<{}} {:<12} {:>12} {:>10} {:>12} {:>10} {:>14} {:>10}  {}";
  const auto add = [&text](std::string line) {
    line.erase(line.find_last_not_of(' ') + 1);
    text += line + '\n';
  };
  add(fmt::format(kRow, "", width, "unit", "estimate", "95 %", "truth", "error", "by equations", "index",
                  ""));
  for (const Estimate& e : result.parameters) {
    const identification::EstimateText cell = text_of(result, e);
    add(fmt::format(kRow, e.name, width, e.unit, cell.value, cell.interval, cell.truth, cell.error,
                    cell.by_equations, cell.index, inside_text(result, e)));
  }
  for (const Estimate& error : result.sensors)
    fmt::format_to(out, "sensor: {}\n", sensor_text(error));
  text += result.wiring.empty() ? "" : "\n";
  for (const identification::WiringFact& fact : result.wiring)
    fmt::format_to(out, "wiring: {}\n", wiring_text(fact));
  fmt::format_to(out, "\nverdict: {}\n", result.excitation.verdict);
  fmt::format_to(out, "error index {:.4g}", result.error_index);
  if (result.mechanical_error_index)
    fmt::format_to(out, ", mechanical {:.4g}", *result.mechanical_error_index);
  fmt::format_to(
      out, ", condition {:.3g}; an index is how far a parameter goes until the error is {} times as large\n",
      result.condition, result.index_factor);
  if (result.explanation) fmt::format_to(out, "{}\n", explanation_text(*result.explanation));
  fmt::format_to(out, "validation: {}\n", validation_text(r));
  for (const std::string& note : result.notes)
    text += note + '\n';
  return text;
}

std::string identify_markdown(const IdentifyReport& r, const std::string& plot) {
  std::string text = fmt::format("# Identification: {}\n\n{}. {}.\n\n{}", r.result.kind, r.source,
                                 settings_text(r), to_markdown(r.result));
  text += fmt::format("\nValidation: {}.\n", validation_text(r));
  if (!plot.empty()) text += fmt::format("\n![measured and re-simulated]({})\n", plot);
  return text;
}

std::string identify_plot(const IdentifyReport& r) {
  if (!r.validation) throw std::runtime_error("no picture: " + r.validation_problem);
  const identification::Resimulation& v = *r.validation;
  std::vector<Panel> panels;
  for (const Resimulated& signal : v.signals) {
    panels.push_back({.label = axis_title(signal.name, signal.unit),
                      .lines = {{"measured", signal.measured}, {"re-simulated", signal.simulated}}});
  }
  for (const Resimulated& signal : v.signals)
    add_residual(panels, signal);
  std::vector<double> times_ms;
  for (std::size_t k = 0; k < v.signals.front().measured.size(); ++k)
    times_ms.push_back(1e3 * v.time_s(k));
  return svg_of(r.source, "time [ms]", times_ms, panels);
}

}  // namespace drivebench::command
