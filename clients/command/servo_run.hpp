#pragma once

#include <bench.pb.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "clients/command/commands.hpp"
#include "clients/control/servo_presets.hpp"
#include "clients/link/axis_link.hpp"

namespace drivebench::command {

/// One sample of a move and what the controller made of it.
struct ServoRow {
  std::uint64_t tick = 0;
  std::int64_t periods = 1;  ///< since the row before
  double time_s = 0.0;       ///< after the start of the trajectory
  double reference_rad = 0.0;
  double angle_rad = 0.0;               ///< since the first sample: true, or else of the encoder
  double error_counts = 0.0;            ///< reference - this angle
  double measured_error_counts = 0.0;   ///< reference - encoder
  double speed_rad_s = 0.0;             ///< true, or else the observer's
  double speed_observer_rad_s = 0.0;    ///< as the controller's observer has it
  double speed_difference_rad_s = 0.0;  ///< by backward difference of the counts
  double i_a_a = 0.0;
  double i_b_a = 0.0;
  double command_a_v = 0.0;
  double command_b_v = 0.0;
  double u_a_v = 0.0;  ///< at the machine during the tick before, if the link carries it
  double u_b_v = 0.0;
  double exchange_us = 0.0;  ///< from handing over the command to having the next sample
};

/// What a move amounted to.
struct ControlReport {
  std::string bench;
  std::string mode;
  std::string axis;
  std::string preset;
  std::string failure;  ///< why it ended early; empty: it did not
  std::int64_t samples = 0;
  std::int64_t missed_ticks = 0;  ///< samples that did not reach the controller
  std::uint64_t late_ticks = 0;   ///< of the bench, during the move
  std::uint64_t first_tick = 0;
  double duration_s = 0.0;  ///< in the bench's time
  double wall_s = 0.0;
  std::string angle_source = "truth";             ///< or "encoder": the link does not carry the truth
  std::string speed_source = "truth";             ///< or "observer"
  double peak_error_counts = 0.0;                 ///< of the angle from angle_source
  double final_error_counts = 0.0;                ///< of the encoder, largest of the last 100 samples
  std::optional<double> final_true_error_counts;  ///< of the true angle, likewise
  double peak_speed_rad_s = 0.0;
  double peak_current_a = 0.0;           ///< measured, either phase
  double peak_command_voltage_v = 0.0;   ///< asked for, either phase
  std::optional<double> peak_voltage_v;  ///< at the machine, either phase
  double exchange_p50_us = 0.0;
  double exchange_p99_us = 0.0;
  double exchange_max_us = 0.0;
};

struct ServoRun {
  bool knows_angle = true;  ///< whether the link carries the true angle
  bool knows_speed = true;
  bool knows_voltage = true;
  std::vector<ServoRow> rows;
  std::string failure;
  std::uint64_t late_ticks = 0;
  double wall_s = 0.0;
};

/// What keeps this preset from running on this axis, one sentence each; empty when it fits.
std::vector<std::string> mismatches(const v1::BenchDescription& bench, std::uint32_t axis,
                                    const control::ServoPreset& preset);

/// Brings an axis that somebody may have used to rest: gates off for 50 ms of the bench's time, in which the
/// rotor flux of a servo motor decays to nothing (in lockstep it would otherwise wait there for ever). Does
/// nothing at tick 0. Throws UsageError if the shaft still turns.
void let_rest(link::AxisLink& bench, double counts_per_revolution);

/// Runs the move on an axis that is leased and at rest, sample by sample, over the link.
ServoRun run_servo_move(link::AxisLink& bench, const control::ServoPreset& preset,
                        const std::vector<LoadAt>& loads);

/// The numbers of the report that follow from the rows.
ControlReport summary_of(const ServoRun& run, double period_s);

/// Everything as CSV, units in the header.
std::string to_csv(const std::vector<ServoRow>& rows);

}  // namespace drivebench::command
