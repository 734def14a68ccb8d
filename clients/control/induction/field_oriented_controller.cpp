#include "clients/control/induction/field_oriented_controller.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <span>
#include <string_view>

#include "clients/control/math/pole_placement.hpp"
#include "plant/math/unbounded.hpp"

namespace drivebench::control {
namespace {

/// References stay this far inside the amplifier's limit.
constexpr double kDirectShareOfLimit = 0.98;

/// The last one is of the observers that estimate a load.
constexpr std::array<std::string_view, 9> kTelemetry = {"i_d_a",
                                                        "i_q_a",
                                                        "i_d_ref_a",
                                                        "i_q_ref_a",
                                                        "flux_wb",
                                                        "flux_angle_rad",
                                                        "speed_difference_rad_s",
                                                        "references_clipped",
                                                        "load_nm"};

std::span<const std::string_view> telemetry_of(const ControllerParameters& p) noexcept {
  const bool with_load = p.flux_observer.source == FluxSource::kRotorFrame;
  return std::span(kTelemetry).first(with_load ? kTelemetry.size() : kTelemetry.size() - 1);
}

double clamped(double x, double limit, bool& clipped) noexcept {
  const double y = std::clamp(x, -limit, limit);
  clipped = y != x;
  return y;
}

}  // namespace

std::vector<std::string> ControllerParameters::problems() const {
  std::vector<std::string> found = range_problems(*this);
  if (!found.empty()) return found;
  found = flux_observer.problems("flux_observer.", machine, period_s());
  if (law == PositionLaw::kNested) {
    const Polynomial<3> loop = {
        nested.speed_proportional_per_s + machine.friction_rate_per_s(),
        nested.speed_integral_per_s2 + nested.speed_proportional_per_s * nested.angle_proportional_per_s,
        nested.speed_integral_per_s2 * nested.angle_proportional_per_s};
    if (!is_hurwitz(loop))
      found.emplace_back("nested.speed_integral_per_s2 and the gains beside it make the loops unstable");
    if (nested.speed_limit_rad_s == 0.0) found.emplace_back("nested.speed_limit_rad_s must be positive");
  }
  return found;
}

FieldOrientedController::FieldOrientedController(const ControllerParameters& p) noexcept
    : Controller(Quantity::kVoltage, telemetry_of(p)),
      p_(p),
      rad_per_count_(2.0 * std::numbers::pi / p.counts_per_revolution),
      amperes_per_acceleration_(1.0 / (p.machine.acceleration_per_wb_a() * p.rated_flux_wb())),
      current_loop_(p.current, p.voltage_limit_v, p.period_s()),
      flux_(p.machine, p.flux_observer, p.period_s()),
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
  flux_.sample({.a = m.i_a_a, .b = m.i_b_a}, out.measured_angle_rad);
  const std::optional<FluxEstimator::Motion> motion = flux_.motion();
  out.speed_observer_rad_s = motion ? motion->speed_rad_s : speed_.speed_rad_s();
  out.load_nm = motion ? motion->load_nm : 0.0;
  out.speed_difference_rad_s = difference_.step(m.encoder_count, periods);
  out.speed_estimate_rad_s =
      p_.speed_source == SpeedSource::kObserver ? out.speed_observer_rad_s : out.speed_difference_rad_s;
  out.flux_estimate_wb = flux_.magnitude_wb();
  out.flux_angle_estimate_rad = flux_.angle_rad();
  const CosSin flux = cos_sin_unbounded(flux_.angle_rad());
  const Dq current_a = to_dq({.a = m.i_a_a, .b = m.i_b_a}, flux);
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
  if (!command.saturated && !quadrature_clipped) {
    angle_integral_rad_s_ += p_.period_s() * angle_error_rad;
    speed_integral_rad_ += p_.period_s() * nested_speed_error_rad_s_;
  }

  last_current_a_ = current_a;
  last_voltage_v_ = command.voltage_v;
  last_angle_rad_ = out.measured_angle_rad;
  last_speed_rad_s_ = out.speed_estimate_rad_s;
  output_ = out;
  const std::array<double, kTelemetry.size()> values = {out.i_d_a,
                                                        out.i_q_a,
                                                        out.i_d_reference_a,
                                                        out.i_q_reference_a,
                                                        out.flux_estimate_wb,
                                                        out.flux_angle_estimate_rad,
                                                        out.speed_difference_rad_s,
                                                        out.references_clipped ? 1.0 : 0.0,
                                                        out.load_nm};
  tell({.angle_rad = out.measured_angle_rad,
        .speed_rad_s = out.speed_observer_rad_s,
        .saturated = out.voltage_saturated},
       std::span(values).first(telemetry_names().size()));
  return {.a = out.u_a_v, .b = out.u_b_v};
}

void FieldOrientedController::carry_observers(std::int64_t periods) noexcept {
  // A longer gap than this is 8 ms at 8 kHz, two time constants of the flux: nothing is left to carry over.
  constexpr std::int64_t kLongestGap = 64;
  const double motor_per_wb = p_.machine.acceleration_per_wb_a() * last_current_a_.q;
  for (std::int64_t i = 0; i < std::min(periods, kLongestGap); ++i) {
    speed_.step(last_angle_rad_, motor_per_wb * flux_.magnitude_wb());
    flux_.step({.current_a = last_current_a_,
                .voltage_v = last_voltage_v_,
                .speed_rad_s = last_speed_rad_s_,
                .shaft_angle_rad = last_angle_rad_});
    last_angle_rad_ += p_.period_s() * last_speed_rad_s_;
  }
}

double FieldOrientedController::direct_reference(double flux_error_wb, bool& clipped) noexcept {
  const double wanted_a = p_.flux.proportional_a_per_wb * flux_error_wb +
                          p_.flux.integral_a_per_wbs * flux_integral_wb_s_ + p_.rated_direct_current_a;
  return clamped(wanted_a, kDirectShareOfLimit * p_.current_limit_a, clipped);
}

double FieldOrientedController::wanted_acceleration_rad_s2(const Reference& r, double angle_error_rad,
                                                           double speed_rad_s) noexcept {
  if (p_.law == PositionLaw::kNested) {
    const NestedServoGains& g = p_.nested;
    const double wanted_rad_s =
        std::clamp(g.angle_proportional_per_s * angle_error_rad + g.speed_share * r.speed_rad_s,
                   -g.speed_limit_rad_s, g.speed_limit_rad_s);
    nested_speed_error_rad_s_ = wanted_rad_s - speed_rad_s;
    return g.speed_proportional_per_s * nested_speed_error_rad_s_ +
           g.speed_integral_per_s2 * speed_integral_rad_;
  }
  return p_.position.integral_per_s3 * angle_integral_rad_s_ +
         p_.position.proportional_per_s2 * angle_error_rad +
         p_.position.derivative_per_s * (r.speed_rad_s - speed_rad_s) +
         p_.machine.friction_rate_per_s() * speed_rad_s + r.acceleration_rad_s2;
}

double FieldOrientedController::quadrature_reference(const Reference& r, double angle_error_rad,
                                                     double speed_rad_s, double i_d_reference_a,
                                                     bool& clipped) noexcept {
  const double acceleration_rad_s2 = wanted_acceleration_rad_s2(r, angle_error_rad, speed_rad_s);
  const double limit_a = p_.quadrature_clip == QuadratureClip::kFixed
                             ? p_.quadrature_reference_limit_a
                             : std::sqrt(std::max(0.0, p_.current_limit_a * p_.current_limit_a -
                                                           i_d_reference_a * i_d_reference_a));
  return clamped(acceleration_rad_s2 * amperes_per_acceleration_, limit_a, clipped);
}

}  // namespace drivebench::control
