#include "clients/control/induction/induction_drive.hpp"

#include <algorithm>
#include <numbers>

#include "clients/control/math/wrapped.hpp"
#include "plant/math/unbounded.hpp"

namespace drivebench::control {

namespace {

/// A longer gap than this is 8 ms at 8 kHz, two time constants of the flux: nothing is left to carry over.
constexpr std::int64_t kLongestGap = 64;

}  // namespace

std::vector<std::string> InductionDriveParameters::problems() const {
  std::vector<std::string> found = range_problems(*this);
  if (motor.leakage() <= 0.0) {  // not for NaN, which was reported before
    found.emplace_back("machine.mutual_inductance_h must be below the root of both inductances' product");
  }
  return found;
}

InductionFeedback::InductionFeedback(const InductionDriveParameters& p) noexcept
    : rad_per_count_(2.0 * std::numbers::pi / p.counts_per_revolution),
      period_s_(p.period_s()),
      observer_(p.motor.machine, p.speed_observer, p.period_s()) {}

const InductionState& InductionFeedback::sample(const Measurement& m, std::int64_t periods) noexcept {
  if (!started_) {
    started_ = true;
    start_count_ = m.encoder_count;
  } else {
    double angle_rad = state_.angle_rad;
    for (std::int64_t i = 0; i < std::min(periods, kLongestGap); ++i) {
      observer_.step(state_.current_a, angle_rad);
      angle_rad += period_s_ * state_.speed_rad_s;
    }
  }
  state_.angle_rad = rad_per_count_ * static_cast<double>(m.encoder_count - start_count_);
  state_.speed_rad_s = observer_.speed_rad_s();
  state_.flux_wb = observer_.flux_magnitude_wb();
  state_.flux_angle_rad = observer_.flux_angle_rad();
  state_.flux = cos_sin_unbounded(state_.flux_angle_rad);
  state_.current_a = to_dq({.a = m.i_a_a, .b = m.i_b_a}, state_.flux);
  return state_;
}

LoadedInductionFeedback::LoadedInductionFeedback(const InductionDriveParameters& p,
                                                 double load_pole_per_s) noexcept
    : rad_per_count_(2.0 * std::numbers::pi / p.counts_per_revolution),
      period_s_(p.period_s()),
      acceleration_per_wb_a_(p.motor.machine.acceleration_per_wb_a()),
      flux_(p.motor.machine, p.period_s()),
      motion_(p.motor.machine,
              LoadObserverGains::placed(load_pole_per_s, load_pole_per_s, load_pole_per_s,
                                        p.motor.machine.friction_rate_per_s()),
              p.period_s()) {}

const InductionState& LoadedInductionFeedback::sample(const Measurement& m, std::int64_t periods) noexcept {
  if (!started_) {
    started_ = true;
    start_count_ = m.encoder_count;
  } else {
    double angle_rad = state_.angle_rad;
    for (std::int64_t i = 0; i < std::min(periods, kLongestGap); ++i) {
      motion_.step(angle_rad, acceleration_per_wb_a_ * flux_.magnitude_wb() * state_.current_a.q);
      flux_.step(state_.current_a);
      angle_rad += period_s_ * state_.speed_rad_s;
    }
  }
  state_.angle_rad = rad_per_count_ * static_cast<double>(m.encoder_count - start_count_);
  state_.speed_rad_s = motion_.speed_rad_s();
  state_.flux_wb = flux_.magnitude_wb();
  state_.flux_angle_rad = wrapped(flux_.angle_rad(state_.angle_rad));
  state_.flux = cos_sin_unbounded(state_.flux_angle_rad);
  state_.current_a = to_dq({.a = m.i_a_a, .b = m.i_b_a}, state_.flux);
  return state_;
}

double clipped(double x, double limit, bool& at_limit) noexcept {
  const double y = std::clamp(x, -limit, limit);
  at_limit = at_limit || y != x;
  return y;
}

Dq decoupled_voltage_v(const InductionMotorModel& motor, const InductionState& x, Dq rate_a_s) noexcept {
  const InductionMachineModel& m = motor.machine;
  const double eta = m.flux_decay_per_s();
  const double gamma = motor.current_decay_per_s();
  const double beta = motor.current_per_wb();
  const double electrical_rad_s = m.pole_pairs * x.speed_rad_s;
  const double flux_speed_rad_s =
      electrical_rad_s + eta * m.mutual_inductance_h * x.current_a.q / x.flux_divisor_wb();
  const auto [i_d, i_q] = x.current_a;
  return {.d = motor.leakage_inductance_h() *
               (gamma * i_d - eta * beta * x.flux_wb - flux_speed_rad_s * i_q + rate_a_s.d),
          .q = motor.leakage_inductance_h() *
               (gamma * i_q + beta * electrical_rad_s * x.flux_wb + flux_speed_rad_s * i_d + rate_a_s.q)};
}

PhaseVoltages held_voltage(const InductionDriveParameters& drive, const InductionState& x,
                           Dq voltage_v) noexcept {
  const double ahead_rad = 0.5 * drive.period_s() * drive.motor.machine.pole_pairs * x.speed_rad_s;
  const TwoPhase wanted_v = to_ab(voltage_v, cos_sin_unbounded(x.flux_angle_rad + ahead_rad));
  bool saturated = false;
  const TwoPhase given_v = {.a = clipped(wanted_v.a, drive.voltage_limit_v, saturated),
                            .b = clipped(wanted_v.b, drive.voltage_limit_v, saturated)};
  return {.voltage_v = given_v, .saturated = saturated};
}

PhaseVoltages DecoupledCurrentLoop::step(const InductionState& x, Dq reference_a,
                                         Dq reference_rate_a_s) const noexcept {
  const Dq rate_a_s = {.d = reference_rate_a_s.d + pole_per_s_ * (reference_a.d - x.current_a.d),
                       .q = reference_rate_a_s.q + pole_per_s_ * (reference_a.q - x.current_a.q)};
  return held_voltage(drive_, x, decoupled_voltage_v(drive_.motor, x, rate_a_s));
}

}  // namespace drivebench::control
