#pragma once

#include "plant/windings.hpp"

namespace drivebench {

/// Section [axis.amplifier]: a linear voltage amplifier per phase. Gain, offsets and delay act in every kind
/// of drive that takes commands. Current limits raise alarms; they do not clip anything.
struct AmplifierParameters {
  double voltage_limit_v = 0.0;   ///< per phase, both signs; also the voltage of the DC link
  double gain = 1.0;              ///< output over command
  double offset_a_v = 0.0;        ///< added to the output of phase a
  double offset_b_v = 0.0;        ///< added to the output of phase b
  double offset_c_v = 0.0;        ///< added to the output of phase c
  double delay_ticks = 0.0;       ///< transport delay from command to output, in parts of a tick as well
  double filter_hz = 0.0;         ///< corner of the first-order output filter; 0: none
  double over_current_a = 0.0;    ///< a phase current above this sets the fault bit
  bool over_current_trip = true;  ///< whether that also switches the gates off
};

/// Voltages of the terminals, and whether one had to be clipped.
struct LimitedVoltages {
  ThreePhase voltage_v;
  bool saturated;
};

/// The command (finite) behind gain and offset, before any limit. The field has no offset.
PhaseValues amplified(const AmplifierParameters& p, const PhaseValues& command_v) noexcept;

/// Each phase within plus and minus the limit.
LimitedVoltages clipped(const ThreePhase& wanted_v, double limit_v) noexcept;

/// The output filter, y' = rate (u - y), under an input that stays: y after a time over which exp(-rate time)
/// is `decay`.
constexpr double filtered(double from, double input, double decay) noexcept {
  return input + (from - input) * decay;
}

}  // namespace drivebench
