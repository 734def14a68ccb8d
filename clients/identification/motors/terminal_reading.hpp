#pragma once

#include <cstddef>
#include <optional>

#include "clients/identification/data/measured_data.hpp"
#include "clients/identification/data/settings.hpp"

namespace drivebench::identification {

/// The reading of a power analyser on a symmetric machine: rms per phase, active and reactive power of all
/// phases, of the fundamental. With DC the squares of voltage and current are means over the phases.
struct MeterReading {
  double voltage_v = 0.0;
  double current_a = 0.0;
  double active_w = 0.0;
  double reactive_var = 0.0;
  double frequency_hz = 0.0;  ///< 0: DC
};

/// The steady part of a record, as meters would read it, and what noise leaves open.
struct TerminalReading {
  MeterReading meter{};
  int phases = 3;
  double real_interval_ohm = 0.0;       ///< half of the 95 % interval of Re Z; with DC of the resistance
  double imaginary_interval_ohm = 0.0;  ///< the same of Im Z
  std::optional<double> speed_rad_s{};  ///< of the shaft, always positive; nothing: not in the record
  double speed_bound_rad_s = 0.0;       ///< what the steps of the encoder leave open of it, at most
  double unbalance = 0.0;               ///< negative over positive sequence of the voltages
  double from_s = 0.0;                  ///< the part that was read
  double to_s = 0.0;
  std::size_t parts = 0;  ///< periods, or pieces of a DC record, of whose scatter the intervals come
};

enum class Feed : std::uint8_t { kDc, kAc };

/// Reads the terminals of a record that is steady in the window of the settings, by default its last third.
/// AC: the frequency is that with which the voltages turn; over whole periods both are turned back by it and
/// averaged, so that noise, offsets and harmonics drop out. The phase of a voltage is moved by
/// `voltage_shift`. Intervals: from the scatter between the periods, and from steps of a converter that no
/// noise rounds off, which a period repeats. Columns: i_a_a, u_a_v and so on; encoder_count (with
/// counts_per_revolution) or angle_rad may be missing. Throws IdentificationError if there are fewer than 5
/// periods, no voltage or current, or if the current is not steady in the window.
TerminalReading read_terminals(const MeasuredData& data, const Settings& settings, Feed feed);

}  // namespace drivebench::identification
