#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "plant/drive/drive.hpp"
#include "plant/injected_faults.hpp"
#include "plant/mechanics/load.hpp"
#include "plant/mechanics/shaft.hpp"
#include "plant/sensors/encoder.hpp"
#include "plant/sensors/sensor_bank.hpp"
#include "plant/thermal.hpp"
#include "plant/train/terminals.hpp"

namespace drivebench {

/// How an axis is stepped; the same for its whole life.
struct AxisTiming {
  double period_s = 0.0;  ///< T
  int substeps = 1;       ///< integration steps per tick, at most kMaxSubsteps
};

inline constexpr int kMaxSubsteps = 64;

/// The state of a machine of any kind, member by member.
inline constexpr std::size_t kMachineWords = 8;
using MachineWords = std::array<double, kMachineWords>;

/// All that an axis remembers between ticks. 8-byte members only: it is saved, restored and hashed as words.
struct AxisState {
  MachineWords machine{};
  TwoMassState shaft;      ///< a rigid shaft uses the rotor's speed and angle only
  std::int64_t turns = 0;  ///< whole turns; the angle of the rotor is within one turn
  EncoderState encoder;
  LoadTorque load;
  DriveMemory drive{};
  SensorMemory sensors{};
  ThermalState thermal{};
  double heat_j = 0.0;  ///< losses of the tick that is running
  InjectedFaults injected{};
  TerminalSet open_terminals = 7;  ///< no current flows through these
  PhaseValues voltage_v{};         ///< at the terminals at the end of the last tick
  double neutral_v = 0.0;          ///< of a star then
  std::uint64_t faults = 0;        ///< of the last tick, with the latched ones
};

/// What the sensors of an axis say at a tick, and the truth beside it.
struct AxisSample {
  PhaseValues current_a{};  ///< measured
  PhaseValues voltage_v{};  ///< measured, at the terminals at the end of the last tick
  double bus_voltage_v = 0.0;
  double neutral_v = 0.0;  ///< of a star against the middle of the DC link
  std::int64_t encoder_count = 0;
  std::uint32_t encoder_levels = 0;
  std::uint32_t hall_lines = 0;
  double edge_age_s = 0.0;
  double edge_period_s = 0.0;
  std::int64_t index_count = 0;
  Tick index_tick = -1;
  double tachometer_v = 0.0;
  double resolver_sine_v = 0.0;
  double resolver_cosine_v = 0.0;
  double temperature_k = 0.0;
  double meter_voltage_v = 0.0;
  double meter_current_a = 0.0;
  double meter_power_w = 0.0;
  double meter_reactive_var = 0.0;
  double meter_power_factor = 0.0;
  std::uint64_t faults = 0;
  std::uint64_t injected = 0;  ///< bit n: row n of kInjectableFaults
  double angle_rad = 0.0;      ///< true angle since the start
  double speed_rad_s = 0.0;
  double torque_nm = 0.0;
  double load_nm = 0.0;
  PhaseValues true_current_a{};
  TwoPhase rotor_flux_wb{};
  double load_angle_rad = 0.0;  ///< of the output
  double load_speed_rad_s = 0.0;
  double load_position_m = 0.0;
};

}  // namespace drivebench
