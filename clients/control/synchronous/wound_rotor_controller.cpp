#include "clients/control/synchronous/wound_rotor_controller.hpp"

#include <algorithm>
#include <cmath>

#include "clients/control/loop/three_phase.hpp"
#include "plant/math/unbounded.hpp"

namespace drivebench::control {

WoundRotorController::WoundRotorController(const WoundRotorParameters& p) noexcept
    : Controller(Quantity::kVoltage, {"i_d_a", "i_q_a", "i_q_ref_a", "i_field_ref_a", "u_d_v", "u_q_v"}),
      p_(p),
      shaft_(p.counts_per_revolution, p.speed_observer, p.machine.friction_rate_per_s(), p.period_s()),
      position_(p.position, p.period_s()) {}

Setpoint WoundRotorController::step(const Measurement& m, const Reference& r, std::int64_t periods) noexcept {
  shaft_.measure(m.encoder_count, periods, last_torque_nm_ / p_.machine.inertia_kgm2);
  const double field_rad = p_.machine.pole_pairs * shaft_.disc_rad();
  const Currents i{.stator = to_dq(stator_currents(m, p_.machine.star), cos_sin_unbounded(field_rad)),
                   .field = m.i_f_a};
  last_torque_nm_ = p_.machine.pole_pairs * p_.machine.mutual_inductance_h * i.field * i.stator.q;

  saturated_ = false;
  const Currents wanted = references(r, i.field);
  const Currents error{.stator = {.d = wanted.stator.d - i.stator.d, .q = wanted.stator.q - i.stator.q},
                       .field = wanted.field - i.field};
  const Voltages u = voltages(i, error);
  if (!saturated_) {
    position_.integrate();
    integral_as_.stator.d += p_.period_s() * error.stator.d;
    integral_as_.stator.q += p_.period_s() * error.stator.q;
    integral_as_.field += p_.period_s() * error.field;
  }
  tell({.angle_rad = shaft_.angle_rad(), .speed_rad_s = shaft_.speed_rad_s(), .saturated = saturated_},
       {i.stator.d, i.stator.q, wanted.stator.q, wanted.field, u.stator.d, u.stator.q});
  const double lead_rad =
      p_.angle_lead_samples * p_.period_s() * p_.machine.pole_pairs * shaft_.speed_rad_s();
  Setpoint out = terminal_values(to_ab(u.stator, cos_sin_unbounded(field_rad + lead_rad)), p_.machine.star);
  out.field = u.field;
  return out;
}

WoundRotorController::Currents WoundRotorController::references(const Reference& r,
                                                                double i_field_a) noexcept {
  // While the field builds up a torque would take endless currents.
  constexpr double kLeastShareOfField = 0.05;
  const double speed_rad_s = shaft_.speed_rad_s();
  const double weakening = std::min(1.0, p_.base_speed_rad_s / std::max(std::abs(speed_rad_s), 1e-9));
  const double torque_per_a = p_.machine.pole_pairs * p_.machine.mutual_inductance_h *
                              std::max(i_field_a, kLeastShareOfField * p_.field_current_a);
  const double acceleration = position_.acceleration_rad_s2(r, shaft_.angle_rad(), speed_rad_s);
  const double wanted_a =
      (p_.machine.inertia_kgm2 * acceleration + p_.machine.friction_nms * speed_rad_s) / torque_per_a;
  const double i_q_a = std::clamp(wanted_a, -p_.current_limit_a, p_.current_limit_a);
  saturated_ = i_q_a != wanted_a;
  return {.stator = {.d = 0.0, .q = i_q_a}, .field = weakening * p_.field_current_a};
}

WoundRotorController::Voltages WoundRotorController::voltages(const Currents& i,
                                                              const Currents& error) noexcept {
  const WoundRotorModel& m = p_.machine;
  const auto slope = [this](double e, double integral) {
    return p_.current.bandwidth_per_s * (e + p_.current.integral_rate_per_s * integral);
  };
  const double slope_d = slope(error.stator.d, integral_as_.stator.d);
  const double slope_q = slope(error.stator.q, integral_as_.stator.q);
  const double wanted_field_v = m.field_resistance_ohm * i.field +
                                m.field_inductance_h * slope(error.field, integral_as_.field) +
                                m.mutual_inductance_h * slope_d;
  const double field_v = std::clamp(wanted_field_v, -p_.field_voltage_limit_v, p_.field_voltage_limit_v);
  // The slope of the field under its limited voltage, which the d axis must balance.
  const double slope_field =
      (field_v - m.field_resistance_ohm * i.field - m.mutual_inductance_h * slope_d) / m.field_inductance_h;
  const double omega_rad_s = m.pole_pairs * shaft_.speed_rad_s();
  const Dq u{.d = m.stator_resistance_ohm * i.stator.d + m.stator_inductance_h * slope_d +
                  m.mutual_inductance_h * slope_field - omega_rad_s * m.stator_inductance_h * i.stator.q,
             .q = m.stator_resistance_ohm * i.stator.q + m.stator_inductance_h * slope_q +
                  omega_rad_s * (m.stator_inductance_h * i.stator.d + m.mutual_inductance_h * i.field)};
  const double limit_v = (m.star ? std::sqrt(1.5) : 1.0) * p_.voltage_limit_v;
  // The d axis first: torque can wait, but a d axis without control weakens or builds up the field.
  const double d_v = std::clamp(u.d, -limit_v, limit_v);
  const double room_v = std::sqrt(limit_v * limit_v - d_v * d_v);
  const double q_v = std::clamp(u.q, -room_v, room_v);
  saturated_ = saturated_ || d_v != u.d || q_v != u.q || field_v != wanted_field_v;
  return {.stator = {.d = d_v, .q = q_v}, .field = field_v};
}

std::vector<std::string> WoundRotorParameters::problems() const {
  std::vector<std::string> found = range_problems(*this);
  if (found.empty() && machine.mutual_inductance_h * machine.mutual_inductance_h >=
                           machine.stator_inductance_h * machine.field_inductance_h) {
    found.emplace_back(
        "machine.mutual_inductance_h squared must be below the product of the other two inductances");
  }
  return found;
}

}  // namespace drivebench::control
