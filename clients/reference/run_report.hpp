#pragma once

#include <bench.pb.h>

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "clients/control/loop/run.hpp"
#include "protocols/signals/catalogue.hpp"
#include "protocols/signals/sample.hpp"

/// What a run of a reference controller on an axis was like.
namespace drivebench::reference {

/// One value for each terminal: phases a, b, c (an armature is a) and the field winding.
using TerminalValues = std::array<double, 4>;

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

/// What is known before a run.
struct RunFacts {
  bool knows_angle = true;  ///< whether the link carries the true angle
  bool knows_speed = true;
  bool knows_voltage = true;
  control::Quantity quantity = control::Quantity::kVoltage;
  double counts_per_rad = 0.0;  ///< 0: unknown
  std::vector<std::string> telemetry_names{};
};

/// The facts of a run over a link with these signals.
RunFacts facts_of(const control::Run& run, SignalMask known, double counts_per_revolution);

/// The row of a sample that the run has just answered. `start_rad`: the true angle of the first sample.
ControlRow row_of(const Sample& sample, const RunFacts& facts, std::int64_t periods, double start_rad,
                  const control::Run& run, const control::Setpoint& setpoint);

/// The reason why a run cannot continue with this sample; empty: it can. The first sample may be from before
/// its faults were cleared.
std::string obstacle(const v1::BenchDescription& bench, const Sample& sample, const control::Measurement& m,
                     bool is_first);

/// The numbers of a report, row by row.
class RunNumbers {
 public:
  RunNumbers(const RunFacts& facts, double period_s);

  /// `telemetry`: a value for each name of the facts.
  void add(const ControlRow& row, std::span<const double> telemetry);
  /// The numbers so far. What links, clocks and names say is the caller's: failure, late ticks, times of
  /// exchanges.
  ControlReport report() const;

 private:
  /// Of one of the last 100 samples.
  struct Errors {
    double measured_rad = 0.0;
    double error_rad = 0.0;
  };
  static constexpr std::size_t kLast = 100;

  RunFacts facts_;
  double period_s_;
  ControlReport report_{};
  std::vector<double> peak_telemetry_;
  double peak_setpoint_ = 0.0;
  double peak_voltage_v_ = 0.0;
  std::uint64_t last_tick_ = 0;
  std::array<Errors, kLast> last_{};
};

/// A number of a report for people.
struct ReportRow {
  std::string name;
  std::string value;
  std::string unit;  ///< may be empty
};

/// The numbers of a report that the run has, in their order.
std::vector<ReportRow> rows_of(const ControlReport& report);

}  // namespace drivebench::reference
