#include "clients/control/synchronous/pm_voltage_controller.hpp"

#include "clients/control/loop/three_phase.hpp"
#include "clients/control/synchronous/pm_references.hpp"
#include "plant/math/unbounded.hpp"

namespace drivebench::control {

PmVoltageController::PmVoltageController(const PmVoltageParameters& p) noexcept
    : Controller(Quantity::kVoltage, {"i_d_a", "i_q_a", "i_d_ref_a", "i_q_ref_a", "u_d_v", "u_q_v"}),
      p_(p),
      shaft_(p.counts_per_revolution, p.speed_observer, p.machine.friction_rate_per_s(), p.period_s(),
             p.speed_source) {}

Setpoint PmVoltageController::step(const Measurement& m, const Reference& r, std::int64_t periods) noexcept {
  shaft_.measure(m.encoder_count, periods, p_.machine.acceleration_per_a() * last_i_q_a_);
  const double magnet_rad = p_.machine.pole_pairs * shaft_.disc_rad();
  const Dq i = to_dq(stator_currents(m, p_.machine.star), cos_sin_unbounded(magnet_rad));
  const PmReferences ref = pm_references(p_.machine, r);
  const Dq u = wanted_voltage_v(r, ref, i);
  const double lead_rad =
      p_.angle_lead_samples * p_.period_s() * p_.machine.pole_pairs * shaft_.speed_rad_s();
  const Setpoint wanted =
      terminal_values(to_ab(u, cos_sin_unbounded(magnet_rad + lead_rad)), p_.machine.star);
  const Setpoint given = clipped(wanted, p_.voltage_limit_v);
  const bool saturated = !same_phases(wanted, given);
  if (!saturated) angle_integral_rad_s_ += p_.period_s() * (shaft_.angle_rad() - r.angle_rad);
  last_i_q_a_ = i.q;
  tell({.angle_rad = shaft_.angle_rad(), .speed_rad_s = shaft_.speed_rad_s(), .saturated = saturated},
       {i.d, i.q, ref.current_a.d, ref.current_a.q, u.d, u.q});
  return given;
}

Dq PmVoltageController::wanted_voltage_v(const Reference& r, const PmReferences& ref, Dq i) const noexcept {
  const PmFeedbackGains& k = p_.feedback;
  const double speed_rad_s = shaft_.speed_rad_s();
  const double l = p_.machine.inductance_h;
  const double v_d = -k.direct_per_s * (i.d - ref.current_a.d);
  const double v_q = -k.quadrature_per_s * (i.q - ref.current_a.q) -
                     k.speed_a_per_rad * (speed_rad_s - r.speed_rad_s) -
                     k.angle_a_per_rad_s * (shaft_.angle_rad() - r.angle_rad) -
                     k.integral_a_per_rads2 * angle_integral_rad_s_;
  const double nl = p_.machine.pole_pairs * l;
  return {.d = ref.voltage_v.d - nl * (speed_rad_s * i.q - r.speed_rad_s * ref.current_a.q) + l * v_d,
          .q = ref.voltage_v.q + nl * (speed_rad_s * i.d - r.speed_rad_s * ref.current_a.d) + l * v_q};
}

}  // namespace drivebench::control
