#include "clients/control/synchronous/pm_current_controller.hpp"

#include <algorithm>
#include <cmath>

#include "clients/control/loop/three_phase.hpp"
#include "clients/control/synchronous/optimum_torque_pm.hpp"
#include "plant/math/unbounded.hpp"

namespace drivebench::control {

PmCurrentController::PmCurrentController(const PmCurrentParameters& p) noexcept
    : Controller(Quantity::kCurrent, {"i_d_a", "i_q_a", "i_d_ref_a", "i_q_ref_a"}),
      p_(p),
      shaft_(p.counts_per_revolution, p.speed_observer, p.machine.friction_rate_per_s(), p.period_s()),
      position_(p.position, p.period_s()) {}

Setpoint PmCurrentController::step(const Measurement& m, const Reference& r, std::int64_t periods) noexcept {
  shaft_.measure(m.encoder_count, periods, p_.machine.acceleration_per_a() * last_i_q_a_);
  const double magnet_rad = p_.machine.pole_pairs * shaft_.disc_rad();
  const Dq i = to_dq(stator_currents(m, p_.machine.star), cos_sin_unbounded(magnet_rad));
  last_i_q_a_ = i.q;

  const double acceleration = position_.acceleration_rad_s2(r, shaft_.angle_rad(), shaft_.speed_rad_s());
  const double wanted_a = (p_.machine.inertia_kgm2 * acceleration + p_.machine.friction_nms * r.speed_rad_s) /
                          p_.machine.torque_constant_nm_per_a;
  const double i_d_a =
      std::max(direct_current_within_voltage_a(p_.machine, p_.voltage_limit_v, r.speed_rad_s, wanted_a),
               -p_.current_limit_a);
  const double room_a = std::sqrt(p_.current_limit_a * p_.current_limit_a - i_d_a * i_d_a);
  const double i_q_a = std::clamp(wanted_a, -room_a, room_a);
  const bool saturated = i_q_a != wanted_a;
  if (!saturated) position_.integrate();

  tell({.angle_rad = shaft_.angle_rad(), .speed_rad_s = shaft_.speed_rad_s(), .saturated = saturated},
       {i.d, i.q, i_d_a, i_q_a});
  const double lead_rad =
      p_.angle_lead_samples * p_.period_s() * p_.machine.pole_pairs * shaft_.speed_rad_s();
  return terminal_values(to_ab({.d = i_d_a, .q = i_q_a}, cos_sin_unbounded(magnet_rad + lead_rad)),
                         p_.machine.star);
}

}  // namespace drivebench::control
