#include "clients/control/synchronous/bldc_controller.hpp"

#include <algorithm>

#include "clients/control/loop/three_phase.hpp"

namespace drivebench::control {

BldcController::BldcController(const BldcParameters& p) noexcept
    : Controller(p.drive, {"i_p_ref_a", "i_p_a", "sector"}),
      p_(p),
      shaft_(p.counts_per_revolution, p.speed_observer, p.machine.friction_rate_per_s(), p.period_s()),
      position_(p.position, p.period_s()) {}

Setpoint BldcController::step(const Measurement& m, const Reference& r, std::int64_t periods) noexcept {
  shaft_.measure(m.encoder_count, periods, p_.machine.acceleration_per_a() * last_current_a_);
  const double ahead_rad = p_.angle_lead_samples * p_.period_s() * shaft_.speed_rad_s();
  const double electrical_rad = p_.machine.pole_pairs * (shaft_.disc_rad() + ahead_rad);
  const std::optional<int> now = sector(m, electrical_rad);
  const Phases pattern = now ? commutation_currents(*now) : Phases{};

  const double wanted_a = position_.acceleration_rad_s2(r, shaft_.angle_rad(), shaft_.speed_rad_s()) /
                          p_.machine.acceleration_per_a();
  const double peak_a = std::clamp(wanted_a, -p_.current_limit_a, p_.current_limit_a);
  saturated_ = peak_a != wanted_a;
  const Phases references_a{peak_a * pattern[0], peak_a * pattern[1], peak_a * pattern[2]};
  const Phases currents_a{m.i_a_a, m.i_b_a, m.i_c_a};
  last_current_a_ =
      0.5 * (pattern[0] * currents_a[0] + pattern[1] * currents_a[1] + pattern[2] * currents_a[2]);

  const Setpoint out = p_.drive == Quantity::kCurrent
                           ? Setpoint{.a = references_a[0], .b = references_a[1], .c = references_a[2]}
                           : voltages(references_a, currents_a, electrical_rad);
  if (!saturated_) position_.integrate();
  tell({.angle_rad = shaft_.angle_rad(), .speed_rad_s = shaft_.speed_rad_s(), .saturated = saturated_},
       {peak_a, last_current_a_, now ? static_cast<double>(*now) : -1.0});
  return out;
}

std::optional<int> BldcController::sector(const Measurement& m, double electrical_rad) const noexcept {
  if (p_.commutation == CommutationBy::kHall) return commutation_sector(m.hall_lines);
  return commutation_sector(electrical_rad);
}

Setpoint BldcController::voltages(const Phases& wanted_a, const Phases& current_a,
                                  double electrical_rad) noexcept {
  const Phases e = trapezoids(electrical_rad);
  const double emf_v = p_.machine.torque_constant_nm_per_a * shaft_.speed_rad_s();
  Phases u{};
  for (std::size_t k = 0; k < 3; ++k) {
    u[k] = p_.current.proportional_v_per_a * (wanted_a[k] - current_a[k]) + integral_v_[k] +
           p_.machine.resistance_ohm * wanted_a[k] - emf_v * e[k];
  }
  // The common part does nothing in a star, so it makes room for the rest.
  const auto [least, most] = std::minmax_element(u.begin(), u.end());
  const double common_v = 0.5 * (*least + *most);
  const Setpoint wanted{.a = u[0] - common_v, .b = u[1] - common_v, .c = u[2] - common_v};
  const Setpoint given = clipped(wanted, p_.voltage_limit_v);
  if (!same_phases(wanted, given)) {
    saturated_ = true;
  } else {
    for (std::size_t k = 0; k < 3; ++k)
      integral_v_[k] += p_.current.integral_v_per_as * p_.period_s() * (wanted_a[k] - current_a[k]);
  }
  return given;
}

}  // namespace drivebench::control
