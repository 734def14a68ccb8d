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
     {"pm", "pm_synchronous", "PM synchronous motor without saliency", MotorKind::kPmSynchronous},
     {"bldc", "bldc", "brushless DC motor in an isolated star", MotorKind::kBldc}}};

/// The row of this name, or null.
const MotorName* find_motor(std::string_view name) noexcept;
const MotorName& motor_name(MotorKind kind) noexcept;

/// Parameters as a bench describes them, by their names: "machine.stator_resistance_ohm".
using BenchParameters = std::map<std::string, double, std::less<>>;

/// What is known about a measurement beside its columns.
struct MeasurementFacts {
  int pole_pairs = 1;
  bool three_phase = true;
  double counts_per_revolution = 0.0;  ///< 0: the angle is measured in rad
  bool half_count = true;              ///< the counts are those of a floor encoder
  /// How long before the sample the reported voltage held [ticks of the bench]: 1 behind a voltage amplifier,
  /// 0 where it is the value at the sample.
  double voltage_held_ticks = 1.0;
  int decimation = 1;  ///< ticks of the bench in a period of the data
  std::string note{};  ///< what the voltages do not show; empty: nothing
};

/// Pole pairs, encoder and voltages as a bench with this drive ("voltage_amplifier", "source", ...), so many
/// steps in a tick and these parameters has them. A bench reports the voltage at the end of the tick: behind
/// a voltage amplifier it held throughout the tick, behind a current amplifier for the last step; a source
/// and an output filter change it all the time. Phases and decimation stay as they are.
void take_facts(const BenchParameters& bench, std::string_view drive, int substeps, MeasurementFacts& facts);

/// Kind, facts and filters that suit both. `voltage_shift` is half the time that a voltage held.
Settings settings_of(MotorKind kind, const MeasurementFacts& facts, double period_s);

/// What identify() should find on a bench with these parameters, by the names of its estimates. Left out is
/// what the method cannot mean: M, L_R, R_R of an induction motor are those of equal leakages; a motor with
/// L_d other than L_q has no L_S; on a shaft with a load of its own there is no J; with a thermal model
/// resistances do not stay what they are.
std::map<std::string, double, std::less<>> truth_of(MotorKind kind, const BenchParameters& bench);

/// Adds what column `load_nm` of the data knows: tau_L and K17 if the load is constant in the window and the
/// method looks for one, else K17 for viscous friction.
void add_load_truth(const MeasuredData& data, const Settings& settings,
                    std::map<std::string, double, std::less<>>& truth);

}  // namespace drivebench::identification
