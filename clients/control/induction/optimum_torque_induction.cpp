#include "clients/control/induction/optimum_torque_induction.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "clients/control/math/polynomial.hpp"
#include "plant/math/length.hpp"

namespace drivebench::control {
namespace {

double sign_of(TorqueSign sign) noexcept {
  return sign == TorqueSign::kMotoring ? 1.0 : -1.0;
}

/// r = T_S/T_R
double ratio_of_times(const SteadyInductionModel& m) noexcept {
  return m.stator_time_s / m.rotor_time_s;
}

/// a = T_S·n_p·ω
double scaled_speed(const SteadyInductionModel& m, double speed_rad_s) noexcept {
  return m.stator_time_s * m.pole_pairs * speed_rad_s;
}

/// k = V/(R_S·I)
double ratio_of_limits(const SteadyInductionModel& m, const VectorLimits& limits) noexcept {
  return limits.voltage_v / (m.stator_resistance_ohm * limits.current_a);
}

/// (|u|/(R_S·i_d))² as a polynomial in δ.
std::array<double, 5> squared_voltage(const SteadyInductionModel& m, double speed_rad_s) noexcept {
  const double r = ratio_of_times(m);
  const double a = scaled_speed(m, speed_rad_s);
  const double s = m.leakage;
  return {1.0 + a * a, 2.0 * a * (1.0 - s + r), (1.0 + r) * (1.0 + r) - 2.0 * s * r + s * s * a * a,
          2.0 * s * s * r * a, s * s * r * r};
}

}  // namespace

SteadyInductionModel SteadyInductionModel::of(const InductionMotorModel& m) noexcept {
  return {.pole_pairs = m.machine.pole_pairs,
          .stator_resistance_ohm = m.stator_resistance_ohm,
          .stator_time_s = m.stator_time_s(),
          .rotor_time_s = 1.0 / m.machine.flux_decay_per_s(),
          .leakage = m.leakage(),
          .torque_nm_per_a2 = m.torque_nm_per_a2()};
}

double SteadyInductionModel::current_a_per_direct(double delta) const noexcept {
  return std::sqrt(1.0 + delta * delta);
}

double SteadyInductionModel::voltage_v_per_direct(double delta, double speed_rad_s) const noexcept {
  const double flux_speed_rad_s = pole_pairs * speed_rad_s + delta / rotor_time_s;
  return stator_resistance_ohm * length(1.0 - leakage * stator_time_s * delta * flux_speed_rad_s,
                                        delta + stator_time_s * flux_speed_rad_s);
}

std::vector<double> voltage_extrema(const SteadyInductionModel& m, double speed_rad_s) {
  // d(δ/P)/dδ = 0 is P − δ·P' = 0, which takes (1 − i) of the coefficient of δ^i.
  std::array<double, 5> p = squared_voltage(m, speed_rad_s);
  for (std::size_t i = 0; i < p.size(); ++i)
    p[i] *= 1.0 - static_cast<double>(i);
  return real_roots(p);
}

std::vector<double> limit_crossings(const SteadyInductionModel& m, const VectorLimits& limits,
                                    double speed_rad_s) {
  const double k = ratio_of_limits(m, limits);
  std::array<double, 5> p = squared_voltage(m, speed_rad_s);
  p[0] -= k * k;
  p[2] -= k * k;
  return real_roots(p);
}

TorquePoint torque_at(const SteadyInductionModel& m, const VectorLimits& limits, double speed_rad_s,
                      double delta) noexcept {
  const double by_current_a = limits.current_a / m.current_a_per_direct(delta);
  const double by_voltage_a = limits.voltage_v / m.voltage_v_per_direct(delta, speed_rad_s);
  const double i_d_a = std::min(by_current_a, by_voltage_a);
  const bool both = std::abs(by_current_a - by_voltage_a) < 1e-6 * i_d_a;
  const TorqueLimit one = by_current_a < by_voltage_a ? TorqueLimit::kCurrent : TorqueLimit::kVoltage;
  return {.torque_nm = m.torque_nm_per_a2 * delta * i_d_a * i_d_a,
          .delta = delta,
          .i_d_a = i_d_a,
          .limit = both ? TorqueLimit::kBoth : one};
}

TorquePoint optimum_torque(const SteadyInductionModel& m, const VectorLimits& limits, double speed_rad_s,
                           TorqueSign sign) {
  std::vector<double> candidates = voltage_extrema(m, speed_rad_s);
  const std::vector<double> crossings = limit_crossings(m, limits, speed_rad_s);
  candidates.insert(candidates.end(), crossings.begin(), crossings.end());
  TorquePoint best = torque_at(m, limits, speed_rad_s, sign_of(sign));
  for (const double delta : candidates) {
    const TorquePoint point = torque_at(m, limits, speed_rad_s, delta);
    if (sign_of(sign) * point.torque_nm > sign_of(sign) * best.torque_nm) best = point;
  }
  return best;
}

OptimumTorqueTable::OptimumTorqueTable(const SteadyInductionModel& m, const VectorLimits& limits,
                                       double top_speed_rad_s, std::size_t intervals)
    : step_rad_s_(top_speed_rad_s / static_cast<double>(intervals)) {
  for (std::size_t i = 0; i <= intervals; ++i) {
    const double speed_rad_s = step_rad_s_ * static_cast<double>(i);
    motoring_.push_back(optimum_torque(m, limits, speed_rad_s, TorqueSign::kMotoring));
    generating_.push_back(optimum_torque(m, limits, speed_rad_s, TorqueSign::kGenerating));
  }
}

TorquePoint OptimumTorqueTable::at(double speed_rad_s, TorqueSign sign) const noexcept {
  const std::vector<TorquePoint>& points = sign == TorqueSign::kMotoring ? motoring_ : generating_;
  const auto last = static_cast<double>(points.size() - 1);
  const double place = std::min(std::abs(speed_rad_s) / step_rad_s_, last);
  const auto below = static_cast<std::size_t>(std::min(place, last - 1.0));
  const double share = place - static_cast<double>(below);
  const TorquePoint& a = points[below];
  const TorquePoint& b = points[below + 1];
  const auto between = [share](double x, double y) { return x + share * (y - x); };
  return {.torque_nm = between(a.torque_nm, b.torque_nm),
          .delta = between(a.delta, b.delta),
          .i_d_a = between(a.i_d_a, b.i_d_a),
          .limit = a.limit};
}

}  // namespace drivebench::control
