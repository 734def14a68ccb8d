#include "clients/control/salient/salient_pm_controller.hpp"

#include <algorithm>

#include "clients/control/loop/three_phase.hpp"
#include "plant/math/length.hpp"
#include "plant/math/unbounded.hpp"

namespace drivebench::control {
namespace {

/// The voltages that make the currents change at these rates.
Dq voltage_for(const SalientPmModel& m, Dq i, Dq rate_a_s, double speed_rad_s) noexcept {
  const double electrical_rad_s = m.pole_pairs * speed_rad_s;
  return {
      .d = m.resistance_ohm * i.d - electrical_rad_s * m.inductance_q_h * i.q + m.inductance_d_h * rate_a_s.d,
      .q = m.resistance_ohm * i.q + electrical_rad_s * (m.inductance_d_h * i.d + m.magnet_flux_wb()) +
           m.inductance_q_h * rate_a_s.q};
}

LeastCurrent current_for(const SalientPmParameters& p, double torque_nm) noexcept {
  if (p.current == SalientCurrent::kLeast) return least_current(p.machine, torque_nm);
  const double per_nm = 1.0 / p.machine.torque_constant_nm_per_a;
  return {.current_a = {.d = 0.0, .q = per_nm * torque_nm}, .slope_a_per_nm = {.d = 0.0, .q = per_nm}};
}

double most_torque_of(const SalientPmParameters& p) noexcept {
  return p.current == SalientCurrent::kLeast ? most_torque_nm(p.machine, p.current_limit_a)
                                             : p.machine.torque_constant_nm_per_a * p.current_limit_a;
}

}  // namespace

std::vector<std::string> SalientPmParameters::problems() const {
  std::vector<std::string> found = range_problems(*this);
  if (found.empty() && torque_pole_per_s * period_s() >= 1.0)
    found.emplace_back("torque_pole_per_s must be below the sample rate");
  return found;
}

SalientReferences salient_references(const SalientPmParameters& p, const Reference& r) noexcept {
  const SalientPmModel& m = p.machine;
  const double torque_nm = m.inertia_kgm2 * r.acceleration_rad_s2 + m.friction_nms * r.speed_rad_s;
  return {.torque_nm = torque_nm,
          .torque_nm_per_s = m.inertia_kgm2 * r.jerk_rad_s3 + m.friction_nms * r.acceleration_rad_s2,
          .least = current_for(p, torque_nm)};
}

Dq salient_voltage_v(const SalientPmModel& m, const SalientReferences& x, double speed_rad_s) noexcept {
  return voltage_for(
      m, x.least.current_a,
      {.d = x.torque_nm_per_s * x.least.slope_a_per_nm.d, .q = x.torque_nm_per_s * x.least.slope_a_per_nm.q},
      speed_rad_s);
}

SalientPmController::SalientPmController(const SalientPmParameters& p) noexcept
    : Controller(Quantity::kVoltage, {"i_d_a", "i_q_a", "i_d_ref_a", "i_q_ref_a", "torque_nm",
                                      "torque_ref_nm", "u_d_v", "u_q_v"}),
      p_(p),
      most_torque_nm_(most_torque_of(p)),
      shaft_(p.counts_per_revolution, p.speed_observer, p.machine.friction_rate_per_s(), p.period_s()),
      position_(p.position, p.period_s()) {}

Dq SalientPmController::wanted_voltage_v(Dq i, double torque_nm, const SalientReferences& to) const noexcept {
  const SalientPmModel& m = p_.machine;
  const double pole = p_.torque_pole_per_s;
  const Dq ref = to.least.current_a;
  const double i_d_rate_a_s = to.torque_nm_per_s * to.least.slope_a_per_nm.d + pole * (ref.d - i.d);
  const double torque_rate_nm_s = to.torque_nm_per_s + pole * (to.torque_nm - torque_nm);
  // On the curve λ + δ·i_d is at least λ; a current far off it must not turn the sign.
  const double active_wb = std::max(m.magnet_flux_wb() + m.saliency_h() * i.d, 0.1 * m.magnet_flux_wb());
  const double i_q_rate_a_s =
      (torque_rate_nm_s / m.pole_pairs - m.saliency_h() * i.q * i_d_rate_a_s) / active_wb;
  return voltage_for(m, i, {.d = i_d_rate_a_s, .q = i_q_rate_a_s}, shaft_.speed_rad_s());
}

Setpoint SalientPmController::step(const Measurement& m, const Reference& r, std::int64_t periods) noexcept {
  const SalientPmModel& machine = p_.machine;
  shaft_.measure(m.encoder_count, periods, last_torque_nm_ / machine.inertia_kgm2);
  const double magnet_rad = machine.pole_pairs * shaft_.disc_rad();
  const Dq i = to_dq(stator_currents(m, machine.star), cos_sin_unbounded(magnet_rad));
  last_torque_nm_ = machine.torque_nm(i.d, i.q);

  SalientReferences to = salient_references(p_, r);
  const double wanted_nm =
      machine.inertia_kgm2 * position_.acceleration_rad_s2(r, shaft_.angle_rad(), shaft_.speed_rad_s()) +
      machine.friction_nms * r.speed_rad_s;
  to.torque_nm = std::clamp(wanted_nm, -most_torque_nm_, most_torque_nm_);
  to.least = current_for(p_, to.torque_nm);

  Dq u = wanted_voltage_v(i, last_torque_nm_, to);
  const double length_v = length(u.d, u.q);
  const bool short_of_voltage = length_v > p_.voltage_limit_v;
  if (short_of_voltage) {
    const double share = p_.voltage_limit_v / length_v;
    u = {.d = share * u.d, .q = share * u.q};
  }
  const bool saturated = short_of_voltage || to.torque_nm != wanted_nm;
  if (!saturated) position_.integrate();

  tell({.angle_rad = shaft_.angle_rad(), .speed_rad_s = shaft_.speed_rad_s(), .saturated = saturated},
       {i.d, i.q, to.least.current_a.d, to.least.current_a.q, last_torque_nm_, to.torque_nm, u.d, u.q});
  const double lead_rad = 0.5 * p_.period_s() * machine.pole_pairs * shaft_.speed_rad_s();
  return terminal_values(to_ab(u, cos_sin_unbounded(magnet_rad + lead_rad)), machine.star);
}

}  // namespace drivebench::control
