#pragma once

#include <numbers>

#include "clients/control/induction/field_oriented_controller.hpp"
#include "clients/control/moves/trajectory.hpp"

/// The numbers of preset book/8.2.2, for those that start from them.
namespace drivebench::control {

/// The book's 1/12 hp two-phase servo motor (8.2.2), 2000 counts, amplifiers of ±80 V and ±6 A, 8 kHz.
/// The 8 A for i_q,ref are ours: the current loop passes on only 0.59 of a quick reference, so a clip at 6 A
/// spoils the tracking long before 6 A flow.
inline constexpr ControllerParameters kServoController = {
    .machine = {.pole_pairs = 3.0,
                .mutual_inductance_h = 0.0117,
                .rotor_resistance_ohm = 3.9,
                .rotor_inductance_h = 0.014,
                .friction_nms = 1.4e-4,
                .inertia_kgm2 = 1.1e-4},
    .sample_rate_hz = 8000.0,
    .counts_per_revolution = 2000.0,
    .voltage_limit_v = 80.0,
    .current_limit_a = 6.0,
    .rated_direct_current_a = 5.5 / std::numbers::sqrt2,
    .quadrature_reference_limit_a = 8.0,
    .current = {.proportional_v_per_a = 6.4, .integral_v_per_as = 740.0},
    .position = {.integral_per_s3 = 1.07e6, .proportional_per_s2 = 7.04e5, .derivative_per_s = 1.07e3},
    .flux = {.proportional_a_per_wb = 1600.0, .integral_a_per_wbs = 23000.0},
    .speed_observer = {.angle_per_s = 1.8e3, .speed_per_s2 = 8e5}};

/// The book gives the length of the move (180° in 73 ms) and its top speed (below 75 rad/s) but not the
/// profile.
inline constexpr TrajectoryParameters kServoMove = {
    .distance_rad = std::numbers::pi, .ramp_up_s = 0.030, .cruise_s = 0.013, .ramp_down_s = 0.030};

}  // namespace drivebench::control
