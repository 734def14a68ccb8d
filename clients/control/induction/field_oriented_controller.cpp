#include "clients/control/induction/field_oriented_controller.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace drivebench::control {
namespace {

/// References stay this far inside the amplifier's limit.
constexpr double kDirectShareOfLimit = 0.98;

double clamped(double x, double limit, bool& clipped) noexcept {
  const double y = std::clamp(x, -limit, limit);
  clipped = y != x;
  return y;
}

}  // namespace

FieldOrientedController::FieldOrientedController(const ControllerParameters& p) noexcept
    : Controller(Quantity::kVoltage, {"i_d_a", "i_q_a", "i_d_ref_a", "i_q_ref_a", "flux_wb", "flux_angle_rad",
                                      "speed_difference_rad_s", "references_clipped"}),
      p_(p),
      rad_per_count_(2.0 * std::numbers::pi / p.counts_per_revolution),
      amperes_per_acceleration_(1.0 / (p.machine.acceleration_per_wb_a() * p.rated_flux_wb())),
      current_loop_(p.current, p.voltage_limit_v, p.period_s()),
      flux_(p.machine, p.period_s()),
      speed_(p.speed_observer, p.machine.friction_rate_per_s(), p.period_s()),
      difference_(p.counts_per_revolution, p.period_s()) {}

Setpoint FieldOrientedController::step(const Measurement& m, const Reference& r,
                                       std::int64_t periods) noexcept {
  if (started_) {
    carry_observers(periods);
  } else {
    started_ = true;
    start_count_ = m.encoder_count;
  }

  ControlOutput out;
  out.measured_angle_rad = rad_per_count_ * static_cast<double>(m.encoder_count - start_count_);
  out.speed_observer_rad_s = speed_.speed_rad_s();
  out.speed_difference_rad_s = difference_.step(m.encoder_count, periods);
  out.speed_estimate_rad_s =
      p_.speed_source == SpeedSource::kObserver ? out.speed_observer_rad_s : out.speed_difference_rad_s;
  out.flux_estimate_wb = flux_.magnitude_wb();
  out.flux_angle_estimate_rad = flux_.angle_rad();
  const Direction flux = Direction::at(flux_.angle_rad());
  const DirectQuadrature current_a = flux.to_dq({.a = m.i_a_a, .b = m.i_b_a});
  out.i_d_a = current_a.d;
  out.i_q_a = current_a.q;

  const double angle_error_rad = r.angle_rad - out.measured_angle_rad;
  const double flux_error_wb = p_.rated_flux_wb() - flux_.magnitude_wb();
  out.position_error_counts = angle_error_rad / rad_per_count_;
  bool direct_clipped = false;
  bool quadrature_clipped = false;
  out.i_d_reference_a = direct_reference(flux_error_wb, direct_clipped);
  out.i_q_reference_a = quadrature_reference(r, angle_error_rad, out.speed_estimate_rad_s,
                                             out.i_d_reference_a, quadrature_clipped);
  out.references_clipped = direct_clipped || quadrature_clipped;

  const PhaseVoltages command = current_loop_.step(
      {.d = out.i_d_reference_a - current_a.d, .q = out.i_q_reference_a - current_a.q}, flux);
  out.u_a_v = command.voltage_v.a;
  out.u_b_v = command.voltage_v.b;
  out.voltage_saturated = command.saturated;
  if (!command.saturated && !direct_clipped) flux_integral_wb_s_ += p_.period_s() * flux_error_wb;
  if (!command.saturated && !quadrature_clipped) angle_integral_rad_s_ += p_.period_s() * angle_error_rad;

  last_current_a_ = current_a;
  last_angle_rad_ = out.measured_angle_rad;
  last_speed_rad_s_ = out.speed_estimate_rad_s;
  output_ = out;
  tell({.angle_rad = out.measured_angle_rad,
        .speed_rad_s = out.speed_observer_rad_s,
        .saturated = out.voltage_saturated},
       {out.i_d_a, out.i_q_a, out.i_d_reference_a, out.i_q_reference_a, out.flux_estimate_wb,
        out.flux_angle_estimate_rad, out.speed_difference_rad_s, out.references_clipped ? 1.0 : 0.0});
  return {.a = out.u_a_v, .b = out.u_b_v};
}

void FieldOrientedController::carry_observers(std::int64_t periods) noexcept {
  // A longer gap than this is 8 ms at 8 kHz, two time constants of the flux: nothing is left to carry over.
  constexpr std::int64_t kLongestGap = 64;
  const double motor_per_wb = p_.machine.acceleration_per_wb_a() * last_current_a_.q;
  for (std::int64_t i = 0; i < std::min(periods, kLongestGap); ++i) {
    speed_.step(last_angle_rad_, motor_per_wb * flux_.magnitude_wb());
    flux_.step(last_current_a_, last_speed_rad_s_);
    last_angle_rad_ += p_.period_s() * last_speed_rad_s_;
  }
}

double FieldOrientedController::direct_reference(double flux_error_wb, bool& clipped) noexcept {
  const double wanted_a = p_.flux.proportional_a_per_wb * flux_error_wb +
                          p_.flux.integral_a_per_wbs * flux_integral_wb_s_ + p_.rated_direct_current_a;
  return clamped(wanted_a, kDirectShareOfLimit * p_.current_limit_a, clipped);
}

double FieldOrientedController::quadrature_reference(const Reference& r, double angle_error_rad,
                                                     double speed_rad_s, double i_d_reference_a,
                                                     bool& clipped) noexcept {
  const double acceleration_rad_s2 = p_.position.integral_per_s3 * angle_integral_rad_s_ +
                                     p_.position.proportional_per_s2 * angle_error_rad +
                                     p_.position.derivative_per_s * (r.speed_rad_s - speed_rad_s) +
                                     p_.machine.friction_rate_per_s() * speed_rad_s + r.acceleration_rad_s2;
  const double limit_a = p_.quadrature_clip == QuadratureClip::kFixed
                             ? p_.quadrature_reference_limit_a
                             : std::sqrt(std::max(0.0, p_.current_limit_a * p_.current_limit_a -
                                                           i_d_reference_a * i_d_reference_a));
  return clamped(acceleration_rad_s2 * amperes_per_acceleration_, limit_a, clipped);
}

}  // namespace drivebench::control
