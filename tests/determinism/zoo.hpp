#pragma once

#include <cstdio>
#include <cstdlib>
#include <initializer_list>
#include <string_view>
#include <utility>
#include <vector>

#include "plant/parameters/parameters.hpp"
#include "server/bench/bench.hpp"

/// A bench with an axis of every kind of machine and of drive, with all sensors, and two of them on one
/// shaft.
namespace drivebench {

using Values = std::vector<std::pair<std::string_view, double>>;

/// The parts that every axis of the zoo has.
inline const Values kEverywhere = {{"mechanics.inertia_kgm2", 1e-3},
                                   {"mechanics.viscous_friction_nms", 1e-3},
                                   {"amplifier.voltage_limit_v", 60},
                                   {"amplifier.over_current_a", 30},
                                   {"amplifier.delay_ticks", 1.5},
                                   {"encoder.counts_per_revolution", 2000},
                                   {"current_sensor.bits", 12},
                                   {"current_sensor.full_scale_a", 40},
                                   {"current_sensor.noise_rms_a", 0.01},
                                   {"current_sensor.filter_hz", 2000},
                                   {"voltage_sensor.enabled", 1},
                                   {"voltage_sensor.full_scale_v", 200},
                                   {"voltage_sensor.delay_ticks", 0.5},
                                   {"tachometer.enabled", 1},
                                   {"tachometer.gain_vs_per_rad", 0.02},
                                   {"tachometer.ripple", 0.01},
                                   {"tachometer.ripple_per_turn", 12},
                                   {"resolver.enabled", 1},
                                   {"resolver.noise_rms_v", 0.001},
                                   {"hall.enabled", 1},
                                   {"meter.enabled", 1},
                                   {"meter.window_s", 0.02},
                                   {"thermal.enabled", 1},
                                   {"thermal.resistance_k_per_w", 1},
                                   {"thermal.time_constant_s", 1}};

inline std::size_t kind_of(std::string_view name) {
  std::size_t kind = 0;
  while (kind < machine_kinds().size() && machine_kinds()[kind] != name)
    ++kind;
  return kind;
}

/// An axis with these values; a broken rule ends the program.
inline AxisSetup animal(std::string_view kind, DriveKind drive, const Values& values,
                        const Curve& curve = {}) {
  AxisSetup axis;
  AxisParameters& p = axis.parameters;
  p.machine = make_machine(kind_of(kind));
  p.drive.kind = drive;
  for (const Values& some : {kEverywhere, values}) {
    for (const auto& [name, value] : some) {
      const Parameter* const row = find_parameter(p, name);
      if (row == nullptr) std::printf("no %s\n", name.data()), std::exit(1);
      row->set(p, value);
    }
  }
  for (const CurveParameter& row : axis_curves(p)) {
    if (row.name.starts_with("machine.") && !curve.empty()) row.set(p, curve);
  }
  for (const Problem& problem : problems(p)) {
    std::printf("%s: %s %s\n", kind.data(), problem.field.c_str(), problem.rule.c_str());
    std::exit(1);
  }
  return axis;
}

inline BenchSetup zoo() {
  const Values kAcMachine = {{"machine.pole_pairs", 2}, {"machine.stator_resistance_ohm", 1.1}};
  const Values kDcMachine = {{"machine.armature_resistance_ohm", 1.3},
                             {"machine.armature_inductance_h", 4e-3}};
  const auto with = [](Values values, const Values& more) {
    values.insert(values.end(), more.begin(), more.end());
    return values;
  };
  const Curve saturation({{0.0, 0.0}, {0.5, 0.4}, {1.0, 0.6}, {3.0, 0.8}});
  const Values kField = {{"machine.motor_constant", 0.5}, {"machine.field_resistance_ohm", 50}};
  const Values kBus = {{"bus.capacitance_f", 1e-3}, {"bus.resistance_ohm", 0.2},
                       {"bus.voltage_v", 60},       {"bus.chopper_on_v", 66},
                       {"bus.chopper_off_v", 63},   {"inverter.dead_time_s", 1e-6}};
  const Values kElastic = {{"mechanics.load_inertia_kgm2", 2e-3}, {"mechanics.shaft_stiffness_nm", 20},
                           {"mechanics.shaft_damping_nms", 1e-3}, {"mechanics.backlash_rad", 0.02},
                           {"mechanics.gear_ratio", 2.5},         {"mechanics.passive_load_nm", 0.01}};
  const Values kMains = {{"source.amplitude_v", 50},
                         {"source.frequency_hz", 50},
                         {"source.resistance_ohm", 0.1},
                         {"source.inductance_h", 1e-4},
                         {"source.amplitude_factor_b", 0.95},
                         {"transformer.turns_ratio", 0.8},
                         {"transformer.primary_resistance_ohm", 0.2},
                         {"transformer.primary_leakage_h", 1e-3},
                         {"transformer.magnetising_inductance_h", 0.3},
                         {"transformer.secondary_resistance_ohm", 0.1}};
  const Values kLoop = {{"current_loop.proportional_v_per_a", 10},
                        {"current_loop.integral_v_per_as", 4000},
                        {"current_loop.limit_a", 10}};
  BenchSetup setup{.period_ns = 100'000, .substeps = 8, .seed = 99, .command_delay_ticks = 1, .axes = {}};
  setup.axes = {
      animal("pm_synchronous", DriveKind::kSwitched,
             with(with(kAcMachine, kBus), {{"machine.inductance_d_h", 3e-3},
                                           {"machine.inductance_q_h", 4e-3},
                                           {"machine.torque_constant_nm_per_a", 0.3},
                                           {"machine.detent_torque_nm", 0.01},
                                           {"machine.star", 1}})),
      animal("bldc", DriveKind::kSwitched,
             with(with(kAcMachine, kBus), {{"machine.self_inductance_h", 2e-3},
                                           {"machine.mutual_inductance_h", 4e-4},
                                           {"machine.torque_constant_nm_per_a", 0.1}})),
      animal("bldc", DriveKind::kAveraged,
             with(with(kAcMachine, kBus), {{"machine.self_inductance_h", 2e-3},
                                           {"machine.mutual_inductance_h", 4e-4},
                                           {"machine.torque_constant_nm_per_a", 0.1},
                                           {"machine.star", 0}})),
      animal("saturated_induction", DriveKind::kSource,
             with(with(kAcMachine, kMains), {{"machine.rotor_resistance_ohm", 1.0},
                                             {"machine.stator_leakage_h", 2e-3},
                                             {"machine.rotor_leakage_h", 2e-3},
                                             {"machine.star", 1}}),
             saturation),
      animal("wound_rotor_synchronous", DriveKind::kVoltage,
             with(with(kAcMachine, kElastic), {{"machine.field_resistance_ohm", 2.0},
                                               {"machine.stator_inductance_h", 0.02},
                                               {"machine.field_inductance_h", 0.05},
                                               {"machine.mutual_inductance_h", 0.02}})),
      animal("pm_dc", DriveKind::kCurrent,
             with(with(with(kDcMachine, kElastic), kLoop), {{"machine.torque_constant_nm_per_a", 0.1}})),
      animal("separately_excited_dc", DriveKind::kVoltage, with(kDcMachine, kField), saturation),
      animal("shunt_dc", DriveKind::kAveraged, with(with(kDcMachine, kField), kBus), saturation),
      animal("series_dc", DriveKind::kVoltage,
             with(with(kDcMachine, kField), {{"machine.field_resistance_ohm", 0.5}}), saturation),
      animal("linear_dc", DriveKind::kVoltage,
             {{"machine.resistance_ohm", 0.5},
              {"machine.inductance_h", 1e-3},
              {"machine.flux_density_t", 0.8},
              {"machine.bar_length_m", 0.3}}),
      animal("induction", DriveKind::kAveraged,
             with(with(kAcMachine, kElastic), {{"machine.rotor_resistance_ohm", 1.0},
                                               {"machine.stator_inductance_h", 0.05},
                                               {"machine.rotor_inductance_h", 0.05},
                                               {"machine.mutual_inductance_h", 0.045},
                                               {"machine.star", 1}})),
      animal("pm_dc", DriveKind::kVoltage, with(kDcMachine, {{"machine.torque_constant_nm_per_a", 0.2}})),
  };
  setup.axes.back().shares_shaft_with = setup.axes.size() - 2;
  setup.axes.back().parameters.mechanics = {.inertia_kgm2 = 1e-3};
  return setup;
}

}  // namespace drivebench
