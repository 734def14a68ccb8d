#include "clients/control/synchronous/pm_speed_controller.hpp"

#include <cmath>

#include "clients/control/loop/three_phase.hpp"
#include "plant/math/unbounded.hpp"

namespace drivebench::control {
namespace {

/// Linear between so many points the torque of the BM500 is within 6e-5 of its largest.
constexpr int kTablePoints = 501;

}  // namespace

PmSpeedController::PmSpeedController(const PmSpeedParameters& p)
    : Controller(Quantity::kVoltage, {"i_d_a", "i_q_a", "i_d_ref_a", "i_q_ref_a", "u_d_v", "u_q_v"}),
      p_(p),
      shaft_(p.counts_per_revolution, p.speed_observer, p.machine.friction_rate_per_s(), p.period_s()),
      table_(p.machine, p.limits(), p.max_speed_rad_s, kTablePoints),
      current_loop_(p.current, p.voltage_limit_v, p.period_s()) {}

Setpoint PmSpeedController::step(const Measurement& m, const Reference& r, std::int64_t periods) noexcept {
  shaft_.measure(m.encoder_count, periods, p_.machine.acceleration_per_a() * last_i_q_a_);
  const double omega_rad_s = p_.machine.pole_pairs * shaft_.speed_rad_s();
  const double magnet_rad = p_.machine.pole_pairs * shaft_.disc_rad();
  const Dq i = to_dq(stator_currents(m, p_.machine.star), cos_sin_unbounded(magnet_rad));
  last_i_q_a_ = i.q;

  const Dq wanted = wanted_current_a(r);
  const double l = p_.machine.inductance_h;
  const Dq u = current_loop_.voltage_v(
      {.d = wanted.d - i.d, .q = wanted.q - i.q},
      {.d = -omega_rad_s * l * i.q,
       .q = omega_rad_s * l * i.d + p_.machine.torque_constant_nm_per_a * shaft_.speed_rad_s()});
  tell({.angle_rad = shaft_.angle_rad(),
        .speed_rad_s = shaft_.speed_rad_s(),
        .saturated = current_loop_.saturated()},
       {i.d, i.q, wanted.d, wanted.q, u.d, u.q});
  const double lead_rad = p_.angle_lead_samples * p_.period_s() * omega_rad_s;
  return terminal_values(to_ab(u, cos_sin_unbounded(magnet_rad + lead_rad)), p_.machine.star);
}

Dq PmSpeedController::wanted_current_a(const Reference& r) const noexcept {
  const double speed_rad_s = shaft_.speed_rad_s();
  const double acceleration = r.acceleration_rad_s2 + p_.speed_gain_per_s * (r.speed_rad_s - speed_rad_s);
  const double i_q_a = (p_.machine.inertia_kgm2 * acceleration + p_.machine.friction_nms * speed_rad_s) /
                       p_.machine.torque_constant_nm_per_a;
  const Dq most = table_.current_a(speed_rad_s, i_q_a);
  if (std::abs(i_q_a) >= std::abs(most.q)) return most;
  return {.d = direct_current_within_voltage_a(p_.machine, p_.voltage_limit_v, speed_rad_s, i_q_a),
          .q = i_q_a};
}

std::vector<std::string> PmSpeedParameters::problems() const {
  std::vector<std::string> found = range_problems(*this);
  if (!found.empty()) return found;
  if (voltage_limit_v <= machine.resistance_ohm * current_limit_a)
    found.emplace_back("voltage_limit_v must exceed machine.resistance_ohm times current_limit_a");
  for (const double direction : {1.0, -1.0}) {
    if (!optimum_torque(machine, limits(), max_speed_rad_s, direction)) {
      found.emplace_back(
          "max_speed_rad_s is above what the machine can be kept within voltage and current limit at");
      break;
    }
  }
  return found;
}

}  // namespace drivebench::control
