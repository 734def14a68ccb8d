#pragma once

#include <array>
#include <map>
#include <string>
#include <string_view>

#include "clients/identification/data/settings.hpp"

namespace drivebench::identification {

/// A kind of motor that can be identified, as command lines and motor files name it.
struct MotorName {
  std::string_view name;     ///< for command lines: im
  std::string_view machine;  ///< in motor files and descriptions of a bench: induction
  std::string_view meaning;
  MotorKind kind;
};

inline constexpr std::array<MotorName, 4> kMotorNames = {
    {{"im", "induction", "induction motor, squirrel cage", MotorKind::kInduction},
     {"dc", "pm_dc", "DC motor with permanent magnets", MotorKind::kDc},
     {"pm", "pm_synchronous", "PM synchronous motor, round or salient", MotorKind::kPmSynchronous},
     {"bldc", "bldc", "brushless DC motor in an isolated star", MotorKind::kBldc}}};

/// The row of this name, or null.
const MotorName* find_motor(std::string_view name) noexcept;
const MotorName& motor_name(MotorKind kind) noexcept;

/// Whether a machine of this kind, as a bench names it, is a motor of this name: an induction motor may have
/// a magnetising curve.
bool is_machine_of(std::string_view machine, std::string_view motor_machine) noexcept;

/// Parameters as a bench describes them, by their names: "machine.stator_resistance_ohm".
using BenchParameters = std::map<std::string, double, std::less<>>;

/// Facts about a measurement beside its columns.
struct MeasurementFacts {
  int pole_pairs = 1;
  bool three_phase = true;
  double counts_per_revolution = 0.0;  ///< 0: the angle is measured in rad
  bool half_count = true;              ///< the counts are those of a floor encoder
  /// The time before the sample during which the reported voltage was constant [ticks of the bench]: 1 behind
  /// a voltage amplifier, 0 for a value at the sample.
  double voltage_held_ticks = 1.0;
  int decimation = 1;  ///< ticks of the bench in a period of the data
  std::string note{};  ///< a limit of the reported voltages; empty: none
};

/// Sets pole pairs, encoder and voltages of a bench with this drive ("voltage_amplifier", "source", ...),
/// number of steps in a tick and parameters. A bench reports the voltage at the end of the tick: behind a
/// voltage amplifier it held throughout the tick, behind a current amplifier for the last step; a source and
/// an output filter change it all the time. Phases and decimation stay unchanged.
void take_facts(const BenchParameters& bench, std::string_view drive, int substeps, MeasurementFacts& facts);

/// The settings for this kind, these facts and the usual filters. `voltage_shift` is half of
/// voltage_held_ticks.
Settings settings_of(MotorKind kind, const MeasurementFacts& facts, double period_s);

/// The true values of the estimates on a bench with these parameters, by the names of the estimates. It
/// leaves out values that a bench does not describe, all that hangs on a magnetising curve, and values that
/// the method does not define: M, L_R, R_R of an induction motor are those of equal leakages; a motor with
/// different L_d and L_q has no L_S, one with equal ones no L_d, L_q, L_g; a shaft with its own load has no
/// J; with a thermal model the resistances change.
std::map<std::string, double, std::less<>> truth_of(MotorKind kind, const BenchParameters& bench);

/// Adds the truth from column `load_nm`: tau_L and K17 if the load is constant in the window and the method
/// estimates one, else K17 for viscous friction.
void add_load_truth(const MeasuredData& data, const Settings& settings,
                    std::map<std::string, double, std::less<>>& truth);

}  // namespace drivebench::identification
