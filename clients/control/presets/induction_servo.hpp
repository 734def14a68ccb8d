#pragma once

#include <numbers>

#include "clients/control/induction/field_oriented_controller.hpp"
#include "clients/control/induction/induction_drive.hpp"
#include "clients/control/moves/trajectory.hpp"
#include "clients/control/presets/preset.hpp"

/// The numbers of preset book/8.2.2, from which others start.
namespace drivebench::control {

/// The book's 1/12 hp two-phase servo motor (8.2.2), 2000 counts, amplifiers of ±80 V and ±6 A, 8 kHz.
inline constexpr InductionDriveParameters kServoDrive8Khz = {
    .motor = {.machine = {.pole_pairs = 3.0,
                          .mutual_inductance_h = 0.0117,
                          .rotor_resistance_ohm = 3.9,
                          .rotor_inductance_h = 0.014,
                          .friction_nms = 1.4e-4,
                          .inertia_kgm2 = 1.1e-4},
              .stator_resistance_ohm = 1.7,
              .stator_inductance_h = 0.014},
    .sample_rate_hz = 8000.0,
    .counts_per_revolution = 2000.0,
    .voltage_limit_v = 80.0,
    .current_limit_a = 6.0,
    .quadrature_reference_limit_a = 8.0,
    .speed_observer = {.angle_per_s = 1.8e3, .speed_per_s2 = 8e5}};

/// The 8 A for i_q,ref are ours: the current loop passes on only 0.59 of a quick reference, so a clip at 6 A
/// spoils the tracking long before 6 A flow.
inline constexpr ControllerParameters kServoController = {
    .machine = kServoDrive8Khz.motor.machine,
    .sample_rate_hz = kServoDrive8Khz.sample_rate_hz,
    .counts_per_revolution = kServoDrive8Khz.counts_per_revolution,
    .voltage_limit_v = kServoDrive8Khz.voltage_limit_v,
    .current_limit_a = kServoDrive8Khz.current_limit_a,
    .rated_direct_current_a = 5.5 / std::numbers::sqrt2,
    .quadrature_reference_limit_a = kServoDrive8Khz.quadrature_reference_limit_a,
    .current = {.proportional_v_per_a = 6.4, .integral_v_per_as = 740.0},
    .position = {.integral_per_s3 = 1.07e6, .proportional_per_s2 = 7.04e5, .derivative_per_s = 1.07e3},
    .flux = {.proportional_a_per_wb = 1600.0, .integral_a_per_wbs = 23000.0},
    .speed_observer = kServoDrive8Khz.speed_observer};

/// The book gives the length of the move (180° in 73 ms) and its top speed (below 75 rad/s) but not the
/// profile.
inline constexpr TrajectoryParameters kServoMove = {
    .distance_rad = std::numbers::pi, .ramp_up_s = 0.030, .cruise_s = 0.013, .ramp_down_s = 0.030};

/// Half a turn with ω_max = 75 rad/s (exercise 15): π/75 = 41.888 ms is t2.
inline constexpr TrajectoryParameters kMoveOfExercise15 = {.distance_rad = std::numbers::pi,
                                                           .ramp_up_s = 0.025,
                                                           .cruise_s = std::numbers::pi / 75.0 - 0.025,
                                                           .ramp_down_s = 0.025};

/// An induction machine with this encoder and at least this voltage.
template <class P>
Requirements induction_needs(const P& p, double pole_pairs) {
  return {.machine_kind = "induction",
          .counts_per_revolution = p.counts_per_revolution,
          .pole_pairs = pole_pairs,
          .voltage_limit_v = p.voltage_limit_v};
}

}  // namespace drivebench::control
