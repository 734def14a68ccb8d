#include "clients/control/synchronous/pm_current_controller.hpp"

#include <algorithm>
#include <cmath>

#include "clients/control/gains/gain_rows.hpp"
#include "clients/control/loop/three_phase.hpp"
#include "clients/control/synchronous/optimum_torque_pm.hpp"
#include "clients/control/synchronous/pm_machine_rows.hpp"

namespace drivebench::control {

PmCurrentController::PmCurrentController(const PmCurrentParameters& p) noexcept
    : p_(p),
      shaft_(p.counts_per_revolution, p.speed_observer, p.machine.friction_rate_per_s(), p.period_s()),
      position_(p.position, p.period_s()) {}

std::span<const std::string_view> PmCurrentController::telemetry_names() const noexcept {
  static constexpr auto kNames =
      std::to_array<std::string_view>({"i_d_a", "i_q_a", "i_d_ref_a", "i_q_ref_a"});
  return kNames;
}

Setpoint PmCurrentController::update(const Measurement& m, const Reference& r,
                                     std::int64_t periods) noexcept {
  shaft_.measure(m.encoder_count, periods, p_.machine.acceleration_per_a() * last_i_q_a_);
  const double magnet_rad = p_.machine.pole_pairs * shaft_.disc_rad();
  const DirectQuadrature i = Direction::at(magnet_rad).to_dq(stator_currents(m, p_.machine.star));
  last_i_q_a_ = i.q;

  const double acceleration = position_.acceleration_rad_s2(r, shaft_.angle_rad(), shaft_.speed_rad_s());
  const double wanted_a = (p_.machine.inertia_kgm2 * acceleration + p_.machine.friction_nms * r.speed_rad_s) /
                          p_.machine.torque_constant_nm_per_a;
  const double i_d_a =
      std::max(direct_current_within_voltage_a(p_.machine, p_.voltage_limit_v, r.speed_rad_s, wanted_a),
               -p_.current_limit_a);
  const double room_a = std::sqrt(p_.current_limit_a * p_.current_limit_a - i_d_a * i_d_a);
  const double i_q_a = std::clamp(wanted_a, -room_a, room_a);
  saturated_ = i_q_a != wanted_a;
  if (!saturated_) position_.integrate();

  telemetry_ = {i.d, i.q, i_d_a, i_q_a};
  const double lead_rad =
      p_.angle_lead_samples * p_.period_s() * p_.machine.pole_pairs * shaft_.speed_rad_s();
  return terminal_values(Direction::at(magnet_rad + lead_rad).to_ab({.d = i_d_a, .q = i_q_a}),
                         p_.machine.star);
}

std::span<const GainRow<PmCurrentParameters>> PmCurrentParameters::gains() noexcept {
  using P = PmCurrentParameters;
  static constexpr auto kRows =
      joined(pm_machine_rows<P>(),
             std::to_array<GainRow<P>>({
                 {"voltage_limit_v", [](P& p) -> double& { return p.voltage_limit_v; }, GainRule::kPositive},
                 {"current_limit_a", [](P& p) -> double& { return p.current_limit_a; }, GainRule::kPositive},
             }),
             position_rows<P>());
  return kRows;
}

std::vector<std::string> PmCurrentParameters::problems() const {
  return range_problems(*this);
}

}  // namespace drivebench::control
