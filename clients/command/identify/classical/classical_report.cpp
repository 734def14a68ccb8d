#include "clients/command/identify/classical/classical_report.hpp"

#include <fmt/core.h>

#include <array>
#include <cmath>
#include <complex>
#include <numbers>
#include <utility>

#include "plant/math/phasor.hpp"
#include "plant/math/trig.hpp"
#include "protocols/number_text.hpp"

namespace drivebench::command {
namespace {

using identification::Estimate;
using identification::MeterReading;
using identification::TerminalTest;

/// Below this part of a parameter a structural error is none.
constexpr double kLeastStructural = 1e-6;

std::complex<double> impedance_of(const MeterReading& m) {
  return phasor(arctangent2(m.reactive_var, m.active_w), m.voltage_v / m.current_a);
}

std::string slip_text(const TestRun& run) {
  if (!run.slip) return "-";
  return run.slip_bound > 0.0 ? fmt::format("{:.2g} +- {:.1g}", *run.slip, run.slip_bound)
                              : fmt::format("{:.2g}", *run.slip);
}

std::string structural_text(const ClassicalReport& r, const Estimate& e) {
  const std::optional<double> error = structural_error(r, e);
  return error ? fmt::format("{:+.3g} %", 100.0 * *error) : "-";
}

std::string branch_text(const ClassicalReport& r, const Estimate& e) {
  if (!structural_error(r, e)) return "-";
  return number_text(identification::value_of(*r.with_branch, e.name));
}

const TestRun* run_named(const ClassicalReport& r, TerminalTest test) {
  for (const TestRun& run : r.runs) {
    if (run.test == test) return &run;
  }
  return nullptr;
}

std::string structure_note(const ClassicalReport& r) {
  if (run_named(r, TerminalTest::kBlockedRotor) == nullptr) return {};
  std::string text =
      "The way of the book counts the magnetising branch as open while the rotor is held, which makes R_R "
      "too "
      "small by about the factor (M/L_R)^2.";
  if (!r.with_branch) {
    return text + (r.runs.size() > 1 ? " No motor has these readings with the branch left in."
                                     : " The tests together (--experiment classical) show by how much.");
  }
  std::string biased;
  for (const Estimate& e : r.result.parameters) {
    if (!structural_error(r, e)) continue;
    biased += fmt::format("{}{} {}", biased.empty() ? "" : ", ", e.name, structural_text(r, e));
  }
  return fmt::format(
      "{} In these readings it makes {}: no longer record takes that away. The column \"branch\" has the "
      "same "
      "readings solved with the branch left in; the other parameters have no such error.",
      text, biased);
}

std::string losses_note(const ClassicalReport& r) {
  const TestRun* const no_load = run_named(r, TerminalTest::kNoLoad);
  if (no_load == nullptr) return {};
  if (!r.losses)
    return "L_S counts a motor without slip. --stator-resistance tells how much power friction and iron "
           "take, "
           "and how far L_S is off for it.";
  std::string text = fmt::format(
      "Without load the motor takes {:.3g} W +- {:.2g} W beside the stator's copper, friction and iron.",
      r.losses->power_w, r.losses->interval_w);
  if (r.losses->power_w <= r.losses->interval_w) text += " The noise does not tell it from nothing.";
  text += " If friction takes all of it,";
  if (r.with_branch) {
    const double omega = 2.0 * std::numbers::pi * no_load->reading.meter.frequency_hz;
    text += fmt::format(" the slip is {:.2g} and",
                        r.losses->slip_angle / (omega * r.with_branch->rotor_time_constant_s));
  }
  text += fmt::format(" L_S is {:.2g} % too small", -100.0 * r.losses->inductance_bias);
  if (no_load->slip) text += fmt::format("; the encoder shows a slip of {}", slip_text(*no_load));
  return text + ".";
}

std::vector<std::string> notes_of(const ClassicalReport& r) {
  std::vector<std::string> notes = {
      "The intervals cover noise and converter steps of these records, not what the tests neglect and not a "
      "gain error of the meters, which goes into every impedance as it is."};
  for (const std::string& note : {structure_note(r), losses_note(r)}) {
    if (!note.empty()) notes.push_back(note);
  }
  constexpr double kWorthTelling = 0.01;
  for (const TestRun& run : r.runs) {
    if (run.reading.unbalance > kWorthTelling)
      notes.push_back(
          fmt::format("{}: the voltages are unbalanced by {:.2g} %; only what turns with the field "
                      "was read.",
                      run.name, 100.0 * run.reading.unbalance));
  }
  return notes;
}

/// Cells of the readings: test, time, frequency, voltage, current, powers, impedance, slip.
std::vector<std::string> cells_of(const TestRun& run) {
  const identification::TerminalReading& reading = run.reading;
  const MeterReading& m = reading.meter;
  const std::complex<double> z = impedance_of(m);
  const bool dc = run.test == TerminalTest::kDcResistance;
  return {run.name,
          fmt::format("{:.4g}-{:.4g}", reading.from_s, reading.to_s),
          dc ? "DC" : number_text(m.frequency_hz),
          number_text(m.voltage_v),
          number_text(m.current_a),
          number_text(m.active_w),
          dc ? "-" : number_text(m.reactive_var),
          number_text(z.real()),
          dc ? "-" : number_text(z.imag()),
          slip_text(run)};
}

std::string line_of_cells(const std::vector<std::string>& cells) {
  std::string text;
  constexpr std::array kWidths = {-14, 9, 7, 9, 9, 8, 8, 11, 11, 16};
  for (std::size_t k = 0; k < kWidths.size(); ++k)
    text += kWidths[k] < 0 ? fmt::format("  {:<{}}", cells[k], -kWidths[k])
                           : fmt::format(" {:>{}}", cells[k], kWidths[k]);
  return text + "\n";
}

const std::vector<std::string> kReadingHeads = {"test",  "time [s]", "f [Hz]",     "U [V rms]",  "I [A rms]",
                                                "P [W]", "Q [var]",  "Re Z [ohm]", "Im Z [ohm]", "slip"};

}  // namespace

std::optional<double> structural_error(const ClassicalReport& r, const Estimate& e) {
  if (!r.with_branch) return std::nullopt;
  const double with_branch = identification::value_of(*r.with_branch, e.name);
  if (with_branch == 0.0) return std::nullopt;
  const double error = e.value / with_branch - 1.0;
  return std::abs(error) < kLeastStructural ? std::nullopt : std::optional(error);
}

std::string classical_text(const ClassicalReport& r) {
  std::string text = r.result.method + "\n";
  for (const TestRun& run : r.runs)
    text += fmt::format("  {:<14} {}\n", run.name, run.source);
  text += "\nas meters read the fundamental, a phase; P and Q of all phases\n" + line_of_cells(kReadingHeads);
  for (const TestRun& run : r.runs)
    text += line_of_cells(cells_of(run));
  constexpr const char* kRow = "  {:<7} {:<5} {:>12} {:>10} {:>12} {:>10} {:>11} {:>12}\n";
  text += "\n" + fmt::format(kRow, "", "unit", "estimate", "95 %", "truth", "error", "structural", "branch");
  for (const Estimate& e : r.result.parameters) {
    const identification::EstimateText cell = text_of(r.result, e);
    text += fmt::format(kRow, e.name, e.unit, cell.value, cell.interval, cell.truth, cell.error,
                        structural_text(r, e), branch_text(r, e));
  }
  text += fmt::format("\nverdict: {}\n", r.result.excitation.verdict);
  for (const std::string& note : notes_of(r))
    text += note + "\n";
  return text;
}

std::string classical_markdown(const ClassicalReport& r) {
  std::string text = fmt::format("# {}\n\n", r.result.method);
  for (const TestRun& run : r.runs)
    text += fmt::format("* {}: {}\n", run.name, run.source);
  text += "\nAs meters read the fundamental, a phase; P and Q of all phases:\n\n";
  const auto row = [&text](const std::vector<std::string>& cells) {
    for (const std::string& cell : cells)
      text += "| " + cell + " ";
    text += "|\n";
  };
  row(kReadingHeads);
  row(std::vector<std::string>(kReadingHeads.size(), "---"));
  for (const TestRun& run : r.runs)
    row(cells_of(run));
  text += "\n";
  row({"parameter", "unit", "estimate", "95 %", "truth", "error", "structural", "with the branch"});
  row(std::vector<std::string>(8, "---"));
  for (const Estimate& e : r.result.parameters) {
    const identification::EstimateText cell = text_of(r.result, e);
    row({e.name, e.unit, cell.value, cell.interval, cell.truth, cell.error, structural_text(r, e),
         branch_text(r, e)});
  }
  text += fmt::format("\nVerdict: {}.\n", r.result.excitation.verdict);
  for (const std::string& note : notes_of(r))
    text += "\n" + note + "\n";
  return text;
}

}  // namespace drivebench::command
