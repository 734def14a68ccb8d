#pragma once

#include <cstddef>
#include <vector>

#include "clients/models/induction_machine.hpp"

namespace drivebench::control {

/// The limits of the amplifier, as lengths of the two-phase vectors: |u| ≤ voltage_v, |i| ≤ current_a.
struct VectorLimits {
  double voltage_v;
  double current_a;
};

/// An induction machine that turns steadily, in the six numbers on which its torque depends. δ = i_q/i_d is
/// also T_R times the slip. With w_S = n_p·ω + δ/T_R the electrical speed of the flux:
///   u_d/R_S = i_d − σ·T_S·i_q·w_S     u_q/R_S = i_q + T_S·i_d·w_S     τ = k_t·i_d·i_q
/// Source: the book, (8.59), (8.60).
struct SteadyInductionModel {
  double pole_pairs;
  double stator_resistance_ohm;
  double stator_time_s;     ///< T_S
  double rotor_time_s;      ///< T_R
  double leakage;           ///< σ
  double torque_nm_per_a2;  ///< k_t

  static SteadyInductionModel of(const InductionMotorModel& m) noexcept;

  double current_a_per_direct(double delta) const noexcept;                      ///< |i|/i_d
  double voltage_v_per_direct(double delta, double speed_rad_s) const noexcept;  ///< |u|/i_d
};

enum class TorqueSign { kMotoring, kGenerating };

enum class TorqueLimit { kCurrent, kVoltage, kBoth };

/// Steady operation at a limit. Rotation counts as positive: generating has negative τ, δ and i_q.
struct TorquePoint {
  double torque_nm;
  double delta;
  double i_d_a;
  TorqueLimit limit;

  double i_q_a() const noexcept { return delta * i_d_a; }
};

/// The δ at which the torque of a given voltage has its extrema, in rising order: the real roots of
///   p = −3σ²r²δ⁴ − 4σ²raδ³ + (2σr − σ²a² − (1+r)²)δ² + 1 + a²     with r = T_S/T_R, a = T_S·n_p·ω
/// Exactly one is positive. Source: (8.68); (8.74) and (8.75) print another sign (IMT-02).
std::vector<double> voltage_extrema(const SteadyInductionModel& m, double speed_rad_s);

/// The δ at which both limits are met at once, in rising order: the real roots of
///   k²(1+δ²) = σ²r²δ⁴ + 2σ²raδ³ + ((1+r)² − 2σr + σ²a²)δ² + 2a(1 − σ + r)δ + 1 + a²     k = V/(R_S·I)
/// (IMT-03).
std::vector<double> limit_crossings(const SteadyInductionModel& m, const VectorLimits& limits,
                                    double speed_rad_s);

/// The most that this δ allows: i_d as large as the tighter of both limits lets it be.
TorquePoint torque_at(const SteadyInductionModel& m, const VectorLimits& limits, double speed_rad_s,
                      double delta) noexcept;

/// The largest torque of the wanted sign at a speed ≥ 0. Over δ the limited torque is smooth but where the
/// limits cross, so its maximum is among |δ| = 1 (current alone, IMT-01), the extrema of the voltage and the
/// crossings; each is tried at the current that both limits allow. So a global optimum of the voltage that
/// the current forbids loses to the local one beside it. Source: 8.4 (IMT-04).
TorquePoint optimum_torque(const SteadyInductionModel& m, const VectorLimits& limits, double speed_rad_s,
                           TorqueSign sign);

/// optimum_torque() over the speed, made once and read on line: linear between its points, beyond the top
/// speed as at the top speed. Reading does not allocate.
class OptimumTorqueTable {
 public:
  OptimumTorqueTable(const SteadyInductionModel& m, const VectorLimits& limits, double top_speed_rad_s,
                     std::size_t intervals = 512);

  /// At |speed|, signs as in TorquePoint; the limit is that of the next point below.
  TorquePoint at(double speed_rad_s, TorqueSign sign) const noexcept;

 private:
  double step_rad_s_;
  std::vector<TorquePoint> motoring_;
  std::vector<TorquePoint> generating_;
};

}  // namespace drivebench::control
