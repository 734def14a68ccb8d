#include "clients/control/induction/induction_demands.hpp"

#include "plant/math/length.hpp"

namespace drivebench::control {

std::array<Demand, 2> InductionDemands::at(const Reference& r, const FluxTarget& flux) const noexcept {
  const InductionMachineModel& m = motor_.machine;
  const double i_d_a = (flux.flux_wb + flux.rate_wb_s / m.flux_decay_per_s()) / m.mutual_inductance_h;
  const double motor_rad_s2 = r.acceleration_rad_s2 + m.friction_rate_per_s() * r.speed_rad_s;
  const double i_q_a = motor_rad_s2 / (m.acceleration_per_wb_a() * flux.flux_wb);
  const double flux_speed_rad_s =
      m.pole_pairs * r.speed_rad_s + m.flux_decay_per_s() * m.mutual_inductance_h * i_q_a / flux.flux_wb;
  const double leakage_ohm = motor_.leakage_inductance_h() * flux_speed_rad_s;
  const double u_d_v =
      motor_.stator_resistance_ohm * i_d_a - leakage_ohm * i_q_a + motor_.stator_share() * flux.rate_wb_s;
  const double u_q_v = motor_.stator_resistance_ohm * i_q_a + leakage_ohm * i_d_a +
                       motor_.stator_share() * flux_speed_rad_s * flux.flux_wb;
  return {{{.quantity = "stator current",
            .value = length(i_d_a, i_q_a),
            .limit = allowance_.current_a,
            .unit = "A"},
           {.quantity = "stator voltage",
            .value = length(u_d_v, u_q_v),
            .limit = allowance_.voltage_v,
            .unit = "V"}}};
}

std::optional<Exceeded> first_exceeded(const Trajectory& move, FluxReference flux, double period_s,
                                       const InductionDemands& demands) {
  return first_exceeded(move.duration_s(), period_s, [&](double t_s) {
    const Reference r = move.at(t_s);
    return demands.at(r, flux.step(r));
  });
}

}  // namespace drivebench::control
