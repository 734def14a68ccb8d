// The usual number of integration steps of a tick.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "plant/axis.hpp"

namespace drivebench {
namespace {

constexpr double kStepsInTimeConstant = 10.0;
// The output of the filter is exact at both ends and in the middle of a step; the machine only smooths it.
constexpr double kStepsInFilter = 2.0;
// Of a battery's R C: a switched inverter has the mean of the link over a step, other drives the link at its
// start.
constexpr double kStepsInLink = 2.0;
constexpr double kStepsInForeseenLink = 0.75;
constexpr double kRadPerStep = 0.2;
// A rotor that swings carries the error of every step on: 3000 random machines on strong sources keep 1e-5.
constexpr double kSwingRadPerStep = 0.01;

/// The fastest electrical angle that the axis is known to turn through [rad/s]: of its source, of its prime
/// mover, and of an emf that reaches the voltage limit.
template <class Machine>
double fastest_turning_rad_s(const AxisParameters& p, const Machine& machine) noexcept {
  double turning_rad_s = 0.0;
  if (p.drive.kind == DriveKind::kSource) {
    turning_rad_s = 2.0 * std::numbers::pi * p.drive.source.frequency_hz;
  }
  if constexpr (requires { machine.pole_pairs; }) {
    if (p.mechanics.motion == ShaftMotion::kImposed) {
      turning_rad_s = std::max(turning_rad_s, machine.pole_pairs * std::abs(p.mechanics.imposed_speed_rad_s));
    }
  }
  if constexpr (requires { electrical_speed_rad_s(machine, 0.0); }) {
    turning_rad_s =
        std::max(turning_rad_s, electrical_speed_rad_s(machine, p.drive.amplifier.voltage_limit_v));
  }
  return turning_rad_s;
}

/// The fastest swing of a rotor against the field of its source [rad/s]; 0: none is known.
template <class Machine>
double fastest_swing_rad_s(const AxisParameters& p, const Machine& machine) noexcept {
  if constexpr (requires { swing_rad_s(machine, 1.0, 1.0, 1.0, 1.0); }) {
    if (p.drive.kind == DriveKind::kSource && p.mechanics.motion != ShaftMotion::kImposed) {
      const SourceParameters& source = p.drive.source;
      const double two_phase = connection_of(machine) == Connection::kStar ? std::sqrt(1.5) : 1.0;
      const double turns_ratio = has_transformer(p.drive.transformer) ? p.drive.transformer.turns_ratio : 1.0;
      return swing_rad_s(machine, p.mechanics.inertia_kgm2, two_phase * turns_ratio * source.amplitude_v,
                         2.0 * std::numbers::pi * source.frequency_hz, source.field_v);
    }
  }
  return 0.0;
}

/// Of the machine behind the impedance of its source. The flux of a transformer is a state more: both rates
/// of a winding behind one are real and below their sum.
template <class Machine>
double fastest_electrical_s(const DriveParameters& p, const Machine& machine) noexcept {
  const SeriesImpedance z = series_impedance(p);
  const double switch_ohm = p.kind == DriveKind::kSwitched ? 2.0 * p.inverter.switch_ohm : 0.0;
  const Adjustment series{.series_resistance_ohm = z.resistance_ohm + switch_ohm,
                          .series_inductance_h = z.inductance_h};
  const double machine_s = fastest_time_constant_s(adjusted(machine, series));
  if (p.kind != DriveKind::kSource || !has_transformer(p.transformer)) return machine_s;
  return 1.0 / (1.0 / machine_s + constants_of(p.transformer).decay_per_s);
}

}  // namespace

int default_substeps(const AxisParameters& p, double period_s) noexcept {
  constexpr double kLongestStepS = 50e-6;
  constexpr double kCurrentLoopS = 20e-6;
  double step_s = p.drive.kind == DriveKind::kCurrent ? kCurrentLoopS : kLongestStepS;
  step_s = std::min(step_s, fastest_time_constant_s(p.mechanics) / kStepsInTimeConstant);
  if (p.drive.amplifier.filter_hz > 0.0) {
    const double filter_s = 1.0 / (2.0 * std::numbers::pi * p.drive.amplifier.filter_hz);
    step_s = std::min(step_s, filter_s / kStepsInFilter);
  }
  if (p.drive.bus.battery && p.drive.bus.resistance_ohm > 0.0) {
    const double steps = p.drive.kind == DriveKind::kSwitched ? kStepsInForeseenLink : kStepsInLink;
    step_s = std::min(step_s, p.drive.bus.resistance_ohm * p.drive.bus.capacitance_f / steps);
  }
  std::visit(
      [&](const auto& machine) {
        step_s = std::min(step_s, fastest_electrical_s(p.drive, machine) / kStepsInTimeConstant);
        if (p.drive.kind == DriveKind::kCurrent) {
          // The loop makes of the machine one with K_P in series: it is stable below 2 L/K_P.
          const Adjustment loop{.series_resistance_ohm = p.drive.current_loop.proportional_v_per_a};
          step_s = std::min(step_s, 0.5 * fastest_time_constant_s(adjusted(machine, loop)));
        }
        const double turning_rad_s = fastest_turning_rad_s(p, machine);
        if (turning_rad_s > 0.0) step_s = std::min(step_s, kRadPerStep / turning_rad_s);
        const double swing_rad_s = fastest_swing_rad_s(p, machine);
        if (swing_rad_s > 0.0) step_s = std::min(step_s, kSwingRadPerStep / swing_rad_s);
      },
      p.machine);
  const double substeps = std::ceil(period_s / step_s - 1e-9);
  return static_cast<int>(std::clamp(substeps, 1.0, static_cast<double>(kMaxSubsteps)));
}

}  // namespace drivebench
