#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "plant/drive/bootstrap.hpp"
#include "plant/drive/break_input.hpp"
#include "plant/drive/drive.hpp"
#include "plant/drive/terminals.hpp"
#include "plant/injected_faults.hpp"
#include "plant/mechanics/load.hpp"
#include "plant/mechanics/shaft.hpp"
#include "plant/sensors/absolute_encoder.hpp"
#include "plant/sensors/comparators.hpp"
#include "plant/sensors/encoder.hpp"
#include "plant/sensors/hall.hpp"
#include "plant/sensors/sensor_bank.hpp"
#include "plant/thermal.hpp"

namespace drivebench {

/// The timing of an axis; the same for its whole life.
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
  // Added later, and zero without SensorParameters::terminals: see kLaterWords<AxisState>.
  ThreePhase terminal_v{};       ///< against the negative rail at the end of the last tick
  ThreePhase terminal_mean_v{};  ///< over that tick; within a tick what its pieces have brought so far
  // Later still, and zero without comparators.
  ComparatorMemory comparators{};
  // Later still, and zero without a break input and with currents that are measured in the wires.
  BreakMemory break_input{};
  ShuntMemory shunts{};
  // Later still, each zero where it is not configured.
  AbsoluteMemory absolute{};
  HallMemory hall{};
  BootstrapMemory bootstrap{};
};

}  // namespace drivebench
