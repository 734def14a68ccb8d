#pragma once

#include <cstdint>

#include "plant/drive/supply/current_trend.hpp"
#include "plant/math/curve.hpp"
#include "plant/windings.hpp"

namespace drivebench {

enum class Waveform : std::int64_t { kSine, kTrapezoid, kTable };

/// Section [axis.source]. Phase k is amplitude_v x its factor at frequency_hz, (k-1) 120 degrees behind phase
/// a in a star or with independent phases, 90 degrees in a two-phase machine. A frequency of 0 is a DC
/// source, a negative one turns the field backwards. All but the table may change while it runs: frequency
/// and amplitude with a continuous phase, phase_rad as a step of the phase.
struct SourceParameters {
  Waveform waveform = Waveform::kSine;
  double amplitude_v = 0.0;  ///< peak, terminal to neutral in a star
  double frequency_hz = 0.0;
  double phase_rad = 0.0;  ///< of phase a at tick 0: cos(phase) for a sine, e(phase) for a trapezoid
  double amplitude_factor_b = 1.0;
  double amplitude_factor_c = 1.0;
  double phase_offset_b_rad = 0.0;
  double phase_offset_c_rad = 0.0;
  double resistance_ohm = 0.0;  ///< in series with each phase, behind a transformer
  double inductance_h = 0.0;
  bool contactor = true;      ///< closed
  bool choose_angle = false;  ///< the contactor waits until phase a is at closing_angle_rad
  double closing_angle_rad = 0.0;
  double start_capacitance_f = 0.0;   ///< > 0: phase b is fed from phase a through this capacitor
  double start_resistance_ohm = 0.0;  ///< and this resistor
  bool start_switch = false;          ///< shorts phase b, u_b = 0, and cuts the capacitor off
  double field_v = 0.0;  ///< of a field supply, in every kind of drive; 0: the field voltage is the command's
  Curve table;           ///< kTable: value over the fraction of a period, 0 .. 1
};

/// The constants of the waveforms, derived from the parameters.
struct SourceConstants {
  ThreePhase factor;      ///< amplitude of the phase over that of phase a; 0 without a terminal
  ThreePhase offset_rad;  ///< phase less that of phase a
  ThreePhase cosine;      ///< factor x cosine of the offset
  ThreePhase sine;
};
SourceConstants constants_of(const SourceParameters& p, Connection connection) noexcept;

/// The voltages at the instant at which phase a is at this angle, for this amplitude.
ThreePhase source_voltages(const SourceParameters& p, const SourceConstants& c, double amplitude_v,
                           double angle_rad) noexcept;

/// The trapezoid e: 0 at angle 0, rising over 60 degrees to a flat top of 120 degrees. Source: the book,
/// (10.7)-(10.8); tag BL-02.
double trapezoid(double angle_rad) noexcept;

/// Whether the corners of the waveform are edges of the drive, so that the steps of a machine end there: in
/// trapezoids and tables of up to 64 points, unless a tick is longer than a period.
bool has_corners(const SourceParameters& p, double period_s) noexcept;

/// Time until the next corner of a phase that exists, of a source for which has_corners() holds.
double time_to_corner_s(const SourceParameters& p, const SourceConstants& c, double angle_rad) noexcept;

/// The angle within [0, 2 pi).
double within_turn(double angle_rad) noexcept;

/// Time until the angle of a source that is at angle_rad comes to target_rad; infinity if it stands still.
double time_until_s(double target_rad, double angle_rad, double omega_rad_s) noexcept;

/// The capacitor through which phase b is fed, u_b = u_a - v_C - R i_b with C v_C' = i_b. 8-byte members
/// only.
struct StartCapacitor {
  double voltage_v = 0.0;
  CurrentTrend current{};
};

/// v_C + R i_b at a time after the start of an interval, at which the current is current_a.
double capacitor_drop_v(const SourceParameters& p, const StartCapacitor& x, double current_a,
                        double time_s) noexcept;

/// The capacitor after an interval with these currents at its ends.
StartCapacitor charged(const SourceParameters& p, const StartCapacitor& x, double from_a, double to_a,
                       double duration_s) noexcept;

}  // namespace drivebench
