#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace drivebench {

/// The faults that can be put into an axis while it runs. A value of 0 is no fault. 8-byte members only; the
/// table below names each, and bit n of Sample.injected shows row n.
struct InjectedFaults {
  double open_phase = 0.0;
  double phase_short = 0.0;
  double neutral_short = 0.0;
  double leg_stuck_high = 0.0;
  double leg_stuck_low = 0.0;
  double leg_stuck_off = 0.0;
  double bus_sag = 0.0;
  double field_loss = 0.0;
  double demagnetisation = 0.0;
  double rotor_resistance_drift = 0.0;
  double stator_resistance_drift = 0.0;
  double blocked_rotor = 0.0;
  double encoder_swapped = 0.0;
  double encoder_lost_line = 0.0;
  double encoder_lost_pulses = 0.0;
  double encoder_index_missing = 0.0;
  double encoder_eccentricity = 0.0;
  double hall_stuck_low = 0.0;
  double hall_stuck_high = 0.0;
  double hall_offset = 0.0;
  double tachometer_loss = 0.0;
  double resolver_loss = 0.0;
  double current_sensor_gain = 0.0;
  double current_sensor_offset = 0.0;
  double current_sensor_stuck = 0.0;
  double command_loss = 0.0;
  double command_delay = 0.0;
  double command_corruption = 0.0;
  double encoder_extra_pulses = 0.0;
  double current_sensor_noise = 0.0;
  double command_duplication = 0.0;
  // Added later: see kLaterWords<AxisState>.
  double gate_driver_fault = 0.0;
};

inline constexpr InjectedFaults kNoFaults{};

/// Name, range and meaning of a fault that can be injected.
struct InjectableFault {
  std::string_view name;
  std::string_view unit;
  double maximum;  ///< of the value; the minimum is 0, which is no fault
  bool integer;    ///< whole numbers only
  bool magnitude;  ///< the value may have either sign
  double InjectedFaults::*member;
  std::string_view meaning;
};

// New rows stand at the end: their numbers are bits on the wires.
inline constexpr auto kInjectableFaults = std::to_array<InjectableFault>({
    {"open_phase", "phase", 3, true, false, &InjectedFaults::open_phase,
     "the wire of phase 1 (a), 2 (b) or 3 (c) breaks; its current dies in an arc at the link voltage"},
    {"phase_short", "pair", 3, true, false, &InjectedFaults::phase_short,
     "a short between terminals: 1 a-b, 2 b-c, 3 c-a"},
    {"neutral_short", "phase", 3, true, false, &InjectedFaults::neutral_short,
     "winding 1 (a), 2 (b) or 3 (c) is shorted; in a star from its terminal to the neutral"},
    {"leg_stuck_high", "phase", 3, true, false, &InjectedFaults::leg_stuck_high,
     "the upper switch of phase 1, 2 or 3 stays closed whatever the gates say"},
    {"leg_stuck_low", "phase", 3, true, false, &InjectedFaults::leg_stuck_low,
     "the lower switch of phase 1, 2 or 3 stays closed whatever the gates say"},
    {"leg_stuck_off", "phase", 3, true, false, &InjectedFaults::leg_stuck_off,
     "both switches of phase 1, 2 or 3 stay open: its diodes are left"},
    {"bus_sag", "1", 1, false, false, &InjectedFaults::bus_sag,
     "the supply falls by this part of its voltage"},
    {"field_loss", "1", 1, true, false, &InjectedFaults::field_loss,
     "the field supply fails; the field current dies through its diode"},
    {"demagnetisation", "1", 1, false, false, &InjectedFaults::demagnetisation,
     "the magnets lose this part of their flux"},
    {"rotor_resistance_drift", "1", 9, false, true, &InjectedFaults::rotor_resistance_drift,
     "the resistance of rotor cage or field winding grows by this part (broken bars, heat)"},
    {"stator_resistance_drift", "1", 9, false, true, &InjectedFaults::stator_resistance_drift,
     "the stator or armature resistance grows by this part"},
    {"blocked_rotor", "1", 1, true, false, &InjectedFaults::blocked_rotor, "the shaft is locked where it is"},
    {"encoder_swapped", "1", 1, true, false, &InjectedFaults::encoder_swapped,
     "A and B are exchanged: the count runs backwards"},
    {"encoder_lost_line", "line", 2, true, false, &InjectedFaults::encoder_lost_line,
     "line 1 (A) or 2 (B) stays low: the count stays within one step"},
    {"encoder_lost_pulses", "counts", 1e6, true, false, &InjectedFaults::encoder_lost_pulses,
     "of every so many counts one is lost"},
    {"encoder_index_missing", "1", 1, true, false, &InjectedFaults::encoder_index_missing,
     "Z does not rise any more"},
    {"encoder_eccentricity", "rad", 0.1, false, false, &InjectedFaults::encoder_eccentricity,
     "amplitude of an angle error once per revolution"},
    {"hall_stuck_low", "line", 3, true, false, &InjectedFaults::hall_stuck_low,
     "Hall line 1, 2 or 3 stays low"},
    {"hall_stuck_high", "line", 3, true, false, &InjectedFaults::hall_stuck_high,
     "Hall line 1, 2 or 3 stays high"},
    {"hall_offset", "rad", 3.15, false, true, &InjectedFaults::hall_offset,
     "electrical angle by which the Hall sensors are displaced"},
    {"tachometer_loss", "1", 1, true, false, &InjectedFaults::tachometer_loss,
     "the tachometer gives its offset only"},
    {"resolver_loss", "winding", 2, true, false, &InjectedFaults::resolver_loss,
     "the sine (1) or cosine (2) winding of the resolver is open"},
    {"current_sensor_gain", "1", 1, false, true, &InjectedFaults::current_sensor_gain,
     "the gain of every current sensor changes by this part"},
    {"current_sensor_offset", "A", 1e6, false, true, &InjectedFaults::current_sensor_offset,
     "added to every measured phase current"},
    {"current_sensor_stuck", "phase", 3, true, false, &InjectedFaults::current_sensor_stuck,
     "the current sensor of phase 1, 2 or 3 says zero"},
    {"command_loss", "1", 1, true, false, &InjectedFaults::command_loss,
     "commands do not reach the drive; the watchdog sees it"},
    {"command_delay", "ticks", 16, true, false, &InjectedFaults::command_delay,
     "commands reach the drive so many ticks later"},
    {"command_corruption", "1", 1, false, false, &InjectedFaults::command_corruption,
     "probability that a command of a tick is replaced by noise of the drive's full scale"},
    {"encoder_extra_pulses", "counts", 1e6, true, false, &InjectedFaults::encoder_extra_pulses,
     "of every so many counts one comes twice"},
    {"current_sensor_noise", "A", 1e6, false, false, &InjectedFaults::current_sensor_noise,
     "added to the rms of the noise of every measured phase current"},
    {"command_duplication", "1", 16, true, false, &InjectedFaults::command_duplication,
     "each command comes so many times more: copies are refused and counted, and feed no watchdog"},
    {"gate_driver_fault", "1", 1, true, false, &InjectedFaults::gate_driver_fault,
     "the fault line of the gate driver: all legs open inverter.break_delay_s after the start of the tick"},
});

inline constexpr std::size_t kInjectableFaultCount = kInjectableFaults.size();
static_assert(sizeof(InjectedFaults) == 8 * kInjectableFaultCount,
              "every member of InjectedFaults has one row");
static_assert(kInjectableFaultCount <= 64);

/// The row with this name, or the number of rows.
constexpr std::size_t find_injectable_fault(std::string_view name) noexcept {
  std::size_t row = 0;
  while (row < kInjectableFaultCount && kInjectableFaults[row].name != name)
    ++row;
  return row;
}

/// Whether the fault is one of the drive and its commands: two axes on one amplifier have it together.
constexpr bool is_of_drive(const InjectableFault& fault) noexcept {
  constexpr auto kMembers = std::to_array<double InjectedFaults::*>(
      {&InjectedFaults::leg_stuck_high, &InjectedFaults::leg_stuck_low, &InjectedFaults::leg_stuck_off,
       &InjectedFaults::bus_sag, &InjectedFaults::field_loss, &InjectedFaults::command_loss,
       &InjectedFaults::command_delay, &InjectedFaults::command_corruption,
       &InjectedFaults::command_duplication, &InjectedFaults::gate_driver_fault});
  for (const auto member : kMembers) {
    if (fault.member == member) return true;
  }
  return false;
}

/// The faults that are in force, as bits: bit n is row n.
constexpr std::uint64_t injected_bits(const InjectedFaults& faults) noexcept {
  std::uint64_t bits = 0;
  for (std::size_t row = 0; row < kInjectableFaultCount; ++row) {
    if (faults.*kInjectableFaults[row].member != 0.0) bits |= std::uint64_t{1} << row;
  }
  return bits;
}

}  // namespace drivebench
