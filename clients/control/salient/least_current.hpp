#pragma once

#include "clients/models/salient_pm_machine.hpp"
#include "plant/math/frames.hpp"

namespace drivebench::control {

/// Currents on the curve of the most torque for an ampere, where the torque has its largest value for |i|:
///   λ·i_d + δ·(i_d² − i_q²) = 0        δ = L_d − L_q, λ = K_m/n_p
/// so that i_d = 2·δ·i_q²/(λ + S) and the torque is n_p·i_q·(λ + S)/2, S = √(λ² + 4·δ²·i_q²). Without a
/// saliency i_d = 0.
struct LeastCurrent {
  Dq current_a;
  Dq slope_a_per_nm;  ///< of both over the torque
};

/// The shortest current that gives this torque. K_m must be positive.
LeastCurrent least_current(const SalientPmModel& m, double torque_nm) noexcept;

/// The largest torque that a current of this length can give, on the same curve.
double most_torque_nm(const SalientPmModel& m, double current_a) noexcept;

}  // namespace drivebench::control
