#include "clients/control/synchronous/optimum_torque_pm.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "plant/math/length.hpp"

namespace drivebench::control {
namespace {

/// A machine turning steadily: u_d = R·i_d − X·i_q, u_q = R·i_q + X·i_d + E.
struct SteadyPm {
  double resistance_ohm;
  double reactance_ohm;  // X = n_p·ω·L
  double emf_v;          // E = K_m·ω

  SteadyPm(const PmMachineModel& p, double speed_rad_s) noexcept
      : resistance_ohm(p.resistance_ohm),
        reactance_ohm(p.pole_pairs * speed_rad_s * p.inductance_h),
        emf_v(p.torque_constant_nm_per_a * speed_rad_s) {}

  double impedance2() const noexcept {
    return resistance_ohm * resistance_ohm + reactance_ohm * reactance_ohm;
  }
  double voltage_v(Dq i) const noexcept {
    return length(resistance_ohm * i.d - reactance_ohm * i.q,
                  resistance_ohm * i.q + reactance_ohm * i.d + emf_v);
  }
};

/// The point at which |i| = I and |u| = V meet, of two the one with the larger sign·i_q. There
///   V² = Z²·I² + E² + 2·E·(R·i_q + X·i_d)
/// so both points lie on a line across the direction (X, R).
std::optional<Dq> meeting_point(const SteadyPm& m, const PmLimits& limits, double sign) noexcept {
  const double impedance_ohm = std::sqrt(m.impedance2());
  const double i = limits.current_a;
  const double along_a = (limits.voltage_v * limits.voltage_v - m.impedance2() * i * i - m.emf_v * m.emf_v) /
                         (2.0 * m.emf_v * impedance_ohm);
  if (!(std::abs(along_a) <= i)) return std::nullopt;
  const double across_a = std::sqrt(i * i - along_a * along_a);
  const double cosine = m.reactance_ohm / impedance_ohm;
  const double sine = m.resistance_ohm / impedance_ohm;
  return Dq{.d = along_a * cosine - sign * across_a * sine, .q = along_a * sine + sign * across_a * cosine};
}

std::optional<PmOptimum> optimum_at_positive_speed(const PmMachineModel& p, const PmLimits& limits,
                                                   double speed_rad_s, double sign) noexcept {
  const SteadyPm m(p, speed_rad_s);
  const auto at = [&p](Dq i, LimitInForce limit) {
    return PmOptimum{.torque_nm = p.torque_constant_nm_per_a * i.q, .current_a = i, .limit = limit};
  };
  const Dq by_current{.d = 0.0, .q = sign * limits.current_a};
  if (m.voltage_v(by_current) <= limits.voltage_v) return at(by_current, LimitInForce::kCurrent);
  const double z2 = m.impedance2();
  const Dq by_voltage{.d = -m.reactance_ohm * m.emf_v / z2,
                      .q = (sign * limits.voltage_v * std::sqrt(z2) - m.emf_v * m.resistance_ohm) / z2};
  if (length(by_voltage.d, by_voltage.q) <= limits.current_a) return at(by_voltage, LimitInForce::kVoltage);
  const auto both = meeting_point(m, limits, sign);
  if (!both) return std::nullopt;
  return at(*both, LimitInForce::kBoth);
}

}  // namespace

std::optional<PmOptimum> optimum_torque(const PmMachineModel& p, const PmLimits& limits, double speed_rad_s,
                                        double direction) noexcept {
  const double sign = direction < 0.0 ? -1.0 : 1.0;
  if (speed_rad_s >= 0.0) return optimum_at_positive_speed(p, limits, speed_rad_s, sign);
  // Backwards everything across the magnet changes sign.
  auto result = optimum_at_positive_speed(p, limits, -speed_rad_s, -sign);
  if (result) {
    result->torque_nm = -result->torque_nm;
    result->current_a.q = -result->current_a.q;
  }
  return result;
}

double steady_voltage_v(const PmMachineModel& p, double speed_rad_s, Dq i) noexcept {
  return SteadyPm(p, speed_rad_s).voltage_v(i);
}

double direct_current_within_voltage_a(const PmMachineModel& p, double voltage_limit_v, double speed_rad_s,
                                       double i_q_a) noexcept {
  // |u|² = Z²·i_d² + 2·X·E·i_d + (X·i_q)² + (R·i_q + E)²
  const SteadyPm m(p, speed_rad_s);
  const double without_v = m.voltage_v({.d = 0.0, .q = i_q_a});
  const double excess_v2 = without_v * without_v - voltage_limit_v * voltage_limit_v;
  if (excess_v2 <= 0.0) return 0.0;
  const double half = m.reactance_ohm * m.emf_v;
  const double discriminant = std::max(0.0, half * half - m.impedance2() * excess_v2);
  return (std::sqrt(discriminant) - half) / m.impedance2();
}

PmTorqueTable::PmTorqueTable(const PmMachineModel& p, const PmLimits& limits, double max_speed_rad_s,
                             int points)
    : rows_per_rad_s_((points - 1) / max_speed_rad_s) {
  if (!(max_speed_rad_s > 0.0) || points < 2)
    throw std::invalid_argument("a torque table needs a largest speed and two points");
  rows_.reserve(static_cast<std::size_t>(points));
  for (int n = 0; n < points; ++n) {
    const auto motoring = optimum_torque(p, limits, n / rows_per_rad_s_, 1.0);
    const auto braking = optimum_torque(p, limits, n / rows_per_rad_s_, -1.0);
    if (!motoring || !braking)
      throw std::invalid_argument("the machine cannot be kept within its limits at the largest speed");
    rows_.push_back({.motoring_a = motoring->current_a, .braking_a = braking->current_a});
  }
}

Dq PmTorqueTable::current_a(double speed_rad_s, double direction) const noexcept {
  const double position =
      std::min(std::abs(speed_rad_s) * rows_per_rad_s_, static_cast<double>(rows_.size() - 1));
  const auto below = std::min(static_cast<std::size_t>(position), rows_.size() - 2);
  const double share = position - static_cast<double>(below);
  const bool motoring = (direction < 0.0) == (speed_rad_s < 0.0);
  const Row& low = rows_[below];
  const Row& high = rows_[below + 1];
  const Dq from = motoring ? low.motoring_a : low.braking_a;
  const Dq to = motoring ? high.motoring_a : high.braking_a;
  const double sign = speed_rad_s < 0.0 ? -1.0 : 1.0;
  return {.d = from.d + share * (to.d - from.d), .q = sign * (from.q + share * (to.q - from.q))};
}

}  // namespace drivebench::control
