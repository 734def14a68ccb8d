#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "clients/control/loop/run.hpp"
#include "clients/control/presets/presets.hpp"
#include "server/bench/bench.hpp"
#include "server/config/config.hpp"

namespace drivebench {

/// The differences from the preset's own bench file.
struct ClosedLoopOptions {
  std::string bench{};  ///< configs/benches/<bench>.toml; empty: the preset's
  std::vector<control::Gain>
      parameters{};              ///< of axis 0, by their names: {"machine.rotor_resistance_ohm", 5.85}
  int command_delay_ticks = -1;  ///< -1: the bench file's
  double sample_rate_hz = 0.0;   ///< 0: the bench file's; the substep stays about as long
};

/// A load torque from a time after the start of the trajectory.
struct LoadStep {
  double load_nm;
  double after_s;
};

/// One sample of a run.
struct ClosedLoopRow {
  double time_s;  ///< since the start of the trajectory
  control::RunPhase phase;
  control::Reference reference;
  Sample sample;               ///< the bench's, the truth included
  control::Setpoint setpoint;  ///< the controller's answer
  double angle_rad;            ///< true, since the first sample of the run
  double error_rad;            ///< reference - true angle
  bool saturated;
  double speed_estimate_rad_s;  ///< the controller's
  std::vector<double> telemetry;
};

/// The result of a run, from prepare to hold unless it says otherwise.
struct Outcome {
  double peak_error_rad = 0.0;  ///< of the true angle
  double peak_error_counts = 0.0;
  double peak_error_while_moving_counts = 0.0;  ///< from the start of the trajectory on
  double final_error_counts = 0.0;              ///< of the true angle, largest of the last 100 samples
  double final_encoder_error_counts = 0.0;
  double peak_speed_rad_s = 0.0;        ///< true
  double peak_speed_error_rad_s = 0.0;  ///< reference - true speed
  double peak_current_a = 0.0;          ///< measured, of any phase
  double peak_field_current_a = 0.0;
  double peak_setpoint = 0.0;          ///< of any phase [V or A]
  double peak_voltage_v = 0.0;         ///< at the machine, of any phase
  std::int64_t saturated_samples = 0;  ///< counted by the controller
  std::int64_t clipped_samples = 0;    ///< counted by the bench: fault bit voltage_saturated
  std::int64_t samples = 0;
  std::uint64_t faults = 0;  ///< of the last sample
  std::vector<std::string_view> telemetry_names;
  std::vector<ClosedLoopRow> rows;

  /// A telemetry column by its name.
  std::size_t column(std::string_view name) const;
  /// The largest magnitude of a telemetry column.
  double peak_of(std::string_view telemetry_name) const;
};

/// A preset's controller on the product's own bench, in process and in lockstep. A run starts where the
/// previous one stopped; time between them passes under the last command.
///   ClosedLoop loop("book/8.2.2", {.parameters = {{"machine.rotor_resistance_ohm", 5.85}}});
///   const Outcome seen = loop.run();
class ClosedLoop {
 public:
  explicit ClosedLoop(std::string_view preset, const ClosedLoopOptions& options = {});

  /// The preset with these gains.
  Outcome run(std::span<const control::Gain> gains = {}, std::span<const LoadStep> loads = {});
  Outcome run(std::vector<control::Gain> gains, std::vector<LoadStep> loads = {}) {
    return run(std::span<const control::Gain>(gains), std::span<const LoadStep>(loads));
  }
  /// A run with its own arguments.
  Outcome run(control::Run run, std::span<const LoadStep> loads = {});
  /// Gates off for so long.
  void rest(double duration_s);
  /// From now on.
  void set_load(double load_nm);
  void set_parameter(std::string_view name, double value);

  Bench& bench() { return bench_; }
  const Sample& sample() const { return bench_.sample(0); }
  double period_s() const { return static_cast<double>(config_.setup.period_ns) * 1e-9; }
  double counts_per_rad() const;

 private:
  void submit(Tick tick, const Action& action);

  const control::Preset& preset_;
  BenchConfig config_;
  Bench bench_;
};

/// Short: one run of a preset on its own bench.
inline Outcome closed_loop(std::string_view preset, const ClosedLoopOptions& options = {},
                           std::vector<control::Gain> gains = {}, std::vector<LoadStep> loads = {}) {
  return ClosedLoop(preset, options).run(std::move(gains), std::move(loads));
}

}  // namespace drivebench
