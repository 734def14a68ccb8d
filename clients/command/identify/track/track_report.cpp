#include "clients/command/identify/track/track_report.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cstdio>
#include <limits>
#include <string_view>

#include "clients/command/recording/svg_plot.hpp"
#include "protocols/number_text.hpp"

namespace drivebench::command {
namespace {

using identification::ResistanceEstimate;

bool is_seen(const ResistanceEstimate& e, std::string_view name) {
  return std::ranges::find(e.excitation.unseen, name) == e.excitation.unseen.end();
}

/// An interval has two digits, so that 0.2 beside 0.25 is 0.20.
std::string cell(bool seen, double value, double interval) {
  if (!seen) return "not seen";
  std::string digits = fmt::format("{:#.2g}", interval);
  if (digits.ends_with('.')) digits.pop_back();
  return fmt::format("{} +- {}", number_text(value), digits);
}

}  // namespace

void TrackReport::heading(const std::string& source, const identification::KnownInductances& known,
                          double window_s) const {
  fmt::print(stderr, "track: {}; L_S {} H and sigma {} are known; a window is {:g} s\n", source,
             number_text(known.stator_inductance_h), number_text(known.leakage_factor), window_s);
  if (!json_)
    fmt::print("{:>10}  {:>20} {:>10}  {:>22} {:>10}  {}\n", "time [s]", "R_S [ohm], 95 %", "truth",
               "T_R [s], 95 %", "truth", "");
}

void TrackReport::gap(std::uint64_t missing, double time_s) {
  ++gaps_;
  if (json_) {
    fmt::print("{}\n", track_gap_json(missing, time_s));
    std::fflush(stdout);
    return;
  }
  fmt::print(stderr, "track: {} samples are missing before {:.4f} s; the window begins anew\n", missing,
             time_s);
}

void TrackReport::add(const TrackRow& row) {
  const ResistanceEstimate& e = row.estimate;
  const bool stator = is_seen(e, "R_S");
  const bool rotor = is_seen(e, "T_R");
  stated_ = stated_ || stator || rotor;
  rows_.push_back(row);
  if (json_) {
    fmt::print("{}\n", track_row_json(row));
  } else {
    const auto truth = [&](double TrackTruth::*value) {
      return row.truth ? number_text(*row.truth.*value) : std::string("-");
    };
    std::string line = fmt::format("{:>10.4f}  {:>20} {:>10}  {:>22} {:>10}  {}", row.time_s,
                                   cell(stator, e.stator_resistance_ohm, e.stator_interval_ohm),
                                   truth(&TrackTruth::stator_resistance_ohm),
                                   cell(rotor, e.rotor_time_constant_s, e.rotor_interval_s),
                                   truth(&TrackTruth::rotor_time_constant_s),
                                   e.excitation.sufficient ? std::string() : e.excitation.verdict);
    line.erase(line.find_last_not_of(' ') + 1);
    fmt::print("{}\n", line);
  }
  std::fflush(stdout);
}

std::string TrackReport::plot(const std::string& title) const {
  constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();
  std::vector<double> time_s;
  Panel stator{.label = "R_S [ohm]", .lines = {{"tracked", {}}, {"truth", {}}}};
  Panel rotor{.label = "T_R [s]", .lines = {{"tracked", {}}, {"truth", {}}}};
  for (const TrackRow& row : rows_) {
    const ResistanceEstimate& e = row.estimate;
    time_s.push_back(row.time_s);
    stator.lines[0].values.push_back(is_seen(e, "R_S") ? e.stator_resistance_ohm : kNothing);
    rotor.lines[0].values.push_back(is_seen(e, "T_R") ? e.rotor_time_constant_s : kNothing);
    stator.lines[1].values.push_back(row.truth ? row.truth->stator_resistance_ohm : kNothing);
    rotor.lines[1].values.push_back(row.truth ? row.truth->rotor_time_constant_s : kNothing);
  }
  if (rows_.empty() || !rows_.back().truth) {
    stator.lines.pop_back();
    rotor.lines.pop_back();
  }
  return svg_of(title, "time [s]", time_s, {stator, rotor});
}

}  // namespace drivebench::command
