#pragma once

#include <numbers>

#include "plant/machines/induction/induction_machine.hpp"

/// The induction motors of the reference.
namespace drivebench::induction_motors {

inline constexpr double kLine_rad_s = 2.0 * std::numbers::pi * 60.0;

// IM-A (IM-04), IM-B (P3-08) and IM-C (P3-11).
inline constexpr InductionMachineParameters kMotorA{.pole_pairs = 3,
                                                    .stator_resistance_ohm = 1.7,
                                                    .rotor_resistance_ohm = 3.9,
                                                    .stator_inductance_h = 0.014,
                                                    .rotor_inductance_h = 0.014,
                                                    .mutual_inductance_h = 0.0117,
                                                    .star = true};
inline constexpr InductionMachineParameters kMotorB{.pole_pairs = 3,
                                                    .stator_resistance_ohm = 1.85,
                                                    .rotor_resistance_ohm = 2.1,
                                                    .stator_inductance_h = 0.244,
                                                    .rotor_inductance_h = 0.244,
                                                    .mutual_inductance_h = 0.225,
                                                    .star = true};
inline constexpr InductionMachineParameters kMotorC{.pole_pairs = 2,
                                                    .stator_resistance_ohm = 2.9,
                                                    .rotor_resistance_ohm = 0.6,
                                                    .stator_inductance_h = 0.157,
                                                    .rotor_inductance_h = 0.157,
                                                    .mutual_inductance_h = 0.148,
                                                    .star = false};
inline constexpr double kInertiaA_kgm2 = 1.1e-4;
inline constexpr double kInertiaB_kgm2 = 0.0185;
inline constexpr double kInertiaC_kgm2 = 0.01;

inline RotorMotion turning(double speed_rad_s) {
  return {.angle_rad = 0.0, .speed_rad_s = speed_rad_s, .electrical = {1.0, 0.0}};
}

}  // namespace drivebench::induction_motors
