#pragma once

#include "plant/windings.hpp"

namespace drivebench {

/// Section [axis.meter]: a power analyser at the stator terminals; every window it gives new figures. The
/// window should hold whole periods of the voltage.
struct MeterParameters {
  bool enabled = false;
  double window_s = 0.1;  ///< rounded to whole ticks
};

/// Integrals over the window that is running.
struct MeterSums {
  double voltage_v2s = 0.0;    ///< of the sum of the squares over the phases
  double current_a2s = 0.0;    ///< the same of the currents
  double energy_j = 0.0;       ///< of the sum of u i over the phases
  double reactive_vars = 0.0;  ///< of the instantaneous reactive power for rotation from a to b
  double turning = 0.0;        ///< its sign is that of the rotation; one phase: 0 or above where i lags u
  double time_s = 0.0;
  double ticks = 0.0;
};

/// The display. Voltage and current are root mean squares over time and phases (of a star line to neutral),
/// so that S = (number of phases) U I. An inductive load takes positive reactive power.
struct MeterFigures {
  double voltage_v = 0.0;
  double current_a = 0.0;
  double power_w = 0.0;
  double reactive_var = 0.0;
  double power_factor = 0.0;  ///< P/S; 0 without voltage or current
};

/// 8-byte members only.
struct MeterMemory {
  MeterSums sums{};
  MeterFigures figures{};  ///< of the last whole window
};

/// Voltages and currents of the terminals at one end of an interval.
struct TerminalPoint {
  const PhaseValues& voltage_v;
  const PhaseValues& current_a;
};

/// Adds an interval. While the voltages stand still in it (a bridge), the currents count as straight lines:
/// exact for their ripple. While they move (an AC source), sums are those of the trapezoidal rule, which is
/// exact for harmonics over whole periods where straight lines would lose (w h)²/6 of the power.
void add_interval(MeterSums& sums, Connection connection, double duration_s, const TerminalPoint& from,
                  const TerminalPoint& to) noexcept;

/// The figures of a window. Reactive power of two and three phases is the mean of u_b i_a - u_a i_b in
/// two-phase coordinates, times the sense in which the current turns; of one phase sqrt(S² - P²), negative
/// where the current leads.
MeterFigures figures_of(const MeterSums& sums, Connection connection) noexcept;

}  // namespace drivebench
