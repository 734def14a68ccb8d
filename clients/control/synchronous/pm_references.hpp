#pragma once

#include "clients/control/moves/trajectory.hpp"
#include "clients/models/pm_machine.hpp"
#include "plant/math/frames.hpp"

namespace drivebench::control {

/// Currents and voltages of a PM machine that follows a trajectory without error.
struct PmReferences {
  Dq current_a;
  Dq slope_a_per_s;  ///< of the currents
  Dq voltage_v;
};

/// The direct current that takes the least voltage at this speed, whatever the torque (optimal lead angle):
///   i_d = −n_p·L_S·K_m·ω²/(R_S² + (n_p·ω·L_S)²)
/// Source: the book, (9.16) (PMC-02).
double optimal_direct_current_a(const PmMachineModel& p, double speed_rad_s) noexcept;

/// Currents and voltages of a point of the trajectory, i_d at the optimal lead angle:
///   i_q = (J·α + f·ω)/K_m        di_q/dt = (J·j + f·α)/K_m
///   di_d/dt = −2·K_m·n_p·ω·L_S·R_S²·α/(R_S² + (n_p·ω·L_S)²)²
///   u_d = L_S·di_d/dt + R_S·i_d − n_p·ω·L_S·i_q        u_q = L_S·di_q/dt + R_S·i_q + n_p·ω·L_S·i_d + K_m·ω
/// Source: the book, (9.21)-(9.26) (PMC-02).
PmReferences pm_references(const PmMachineModel& p, const Reference& r) noexcept;

}  // namespace drivebench::control
