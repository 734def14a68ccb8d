#pragma once

#include <bench.pb.h>

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "clients/control/loop/run.hpp"
#include "clients/link/common/axis_link.hpp"

namespace drivebench::command {

/// One value for each terminal: phases a, b, c (an armature is a) and the field winding.
using TerminalValues = std::array<double, 4>;

/// A load torque at a time after the start of the trajectory.
struct LoadAt {
  double load_nm = 0.0;
  double after_s = 0.0;
};

TerminalValues terminal_values_of(const control::Setpoint& setpoint);

/// A sample of a run and the controller's answer.
struct ControlRow {
  std::uint64_t tick = 0;
  std::int64_t periods = 1;  ///< since the previous row
  double time_s = 0.0;       ///< after the start of the trajectory
  control::Reference reference{};
  std::int64_t encoder_count = 0;
  double shaft_rad = 0.0;           ///< the true angle as the sample has it, if the link carries it
  double angle_rad = 0.0;           ///< since the first sample: the true angle, or else that of the encoder
  double error_rad = 0.0;           ///< reference - this angle
  double measured_error_rad = 0.0;  ///< reference - encoder
  double speed_rad_s = 0.0;         ///< the true speed, or else the observer's
  double speed_observer_rad_s = 0.0;
  TerminalValues current_a{};
  TerminalValues setpoint{};   ///< commanded, [V] or [A]
  TerminalValues voltage_v{};  ///< at the machine during the previous tick, if the link carries it
  bool saturated = false;
  double exchange_us = 0.0;  ///< from sending the command to receiving the next sample
};

/// The summary of a run. Phases are a, b and c; the field winding is separate.
struct ControlReport {
  std::string bench;
  std::string mode;
  std::string axis;
  std::string preset;
  std::string failure;  ///< the reason of an early end; empty: none
  std::int64_t samples = 0;
  std::int64_t missed_ticks = 0;  ///< samples that did not reach the controller
  std::uint64_t late_ticks = 0;   ///< of the bench, during the run
  std::uint64_t first_tick = 0;
  double duration_s = 0.0;  ///< in the bench's time
  double wall_s = 0.0;
  std::string angle_source = "truth";  ///< or "encoder": the link does not carry the truth
  std::string speed_source = "truth";  ///< or "observer"
  double peak_error_rad = 0.0;         ///< of the angle from angle_source
  double final_error_rad = 0.0;        ///< of the encoder, largest of the last 100 samples
  std::optional<double> peak_error_counts;
  std::optional<double> final_error_counts;
  std::optional<double> final_true_error_counts;  ///< of the true angle, likewise
  double peak_speed_rad_s = 0.0;
  double peak_speed_error_rad_s = 0.0;  ///< reference - speed
  double peak_current_a = 0.0;          ///< measured
  double peak_field_current_a = 0.0;
  std::optional<double> peak_command_voltage_v;  ///< nothing if the run commands currents
  std::optional<double> peak_command_current_a;  ///< nothing if the run commands voltages
  std::optional<double> peak_voltage_v;          ///< at the machine
  std::int64_t saturated_samples = 0;            ///< samples with a command at its limit
  std::map<std::string, double> peak_telemetry;  ///< largest magnitudes of the controller's telemetry
  double exchange_p50_us = 0.0;
  double exchange_p99_us = 0.0;
  double exchange_max_us = 0.0;
};

/// The record of a run over a link.
struct ControlRun {
  bool knows_angle = true;  ///< whether the link carries the true angle
  bool knows_speed = true;
  bool knows_voltage = true;
  control::Quantity quantity = control::Quantity::kVoltage;
  double counts_per_rad = 0.0;  ///< 0: unknown
  std::vector<ControlRow> rows;
  std::vector<std::string> telemetry_names;
  std::vector<double> telemetry;  ///< of all rows, concatenated
  std::string failure;
  std::int64_t missed_at_end = 0;  ///< samples after the last row that did not reach the controller
  std::uint64_t late_ticks = 0;
  double wall_s = 0.0;
};

/// Runs a controller over the link, sample by sample, on an axis that is leased and at rest.
/// `counts_per_revolution` converts angles to counts for the report; 0: no encoder. A second of the bench
/// lasts at least `slowness` seconds.
ControlRun run_over(link::AxisLink& bench, control::Run run, const std::vector<LoadAt>& loads,
                    double counts_per_revolution, double slowness = 0.0);

/// The numbers of the report that follow from the rows.
ControlReport summary_of(const ControlRun& run, double period_s);

/// Everything as CSV in the header dialect of export: `tick,time_s,NAME [UNIT]`; the bench's signals have
/// their names in the catalogue, so that `identify --from` reads them, and the controller's telemetry begins
/// with `controller_`. Columns that the link does not carry are left out.
std::string to_csv(const ControlRun& run);

}  // namespace drivebench::command
