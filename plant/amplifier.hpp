#pragma once

#include <cstdint>

#include "plant/frames.hpp"

namespace drivebench {

/// A linear voltage amplifier per phase. Current limits raise alarms; they do not clip anything.
struct AmplifierParameters {
  double voltage_limit_v = 0.0;   ///< per phase, both signs; also the voltage of the DC link
  double gain = 1.0;              ///< output over command
  double offset_a_v = 0.0;        ///< added to the output of phase a
  double offset_b_v = 0.0;        ///< added to the output of phase b
  double over_current_a = 0.0;    ///< a phase current above this sets the fault bit
  bool over_current_trip = true;  ///< whether that also switches the gates off
};

/// What the gates do during a tick.
enum class Gates : std::int64_t {
  kOff = 0,          ///< freewheel: currents flow through the diodes into the DC link until they are zero
  kVoltage = 1,      ///< the commanded voltages
  kZeroVoltage = 2,  ///< active short circuit
};

/// What a controller (or the safe action) asks of the amplifier for one tick; zero-order hold.
struct PhaseCommand {
  Gates gates = Gates::kOff;
  TwoPhase voltage_v{};
};

/// The voltages that the amplifier puts out, and whether it had to clip them.
struct AmplifierOutput {
  TwoPhase voltage_v;
  bool saturated;
};

/// Output for a command with the gates on: gain, offset, then the voltage limit. The command must be finite.
AmplifierOutput amplifier_output(const AmplifierParameters& p, const PhaseCommand& command) noexcept;

}  // namespace drivebench
