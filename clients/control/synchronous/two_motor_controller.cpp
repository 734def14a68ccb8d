#include "clients/control/synchronous/two_motor_controller.hpp"

#include <algorithm>
#include <cmath>

#include "clients/control/loop/three_phase.hpp"
#include "plant/math/frames.hpp"
#include "plant/math/unbounded.hpp"

namespace drivebench::control {
namespace {

/// Shortened to the limit, so that the direction stays.
TwoPhase shortened(TwoPhase u, double limit_v) noexcept {
  const double excess = std::max({std::abs(u.a) / limit_v, std::abs(u.b) / limit_v, 1.0});
  return {.a = u.a / excess, .b = u.b / excess};
}

}  // namespace

Reference FallBack::behind(const Reference& first) const noexcept {
  // A ramp of speed over time, read as one of distance over the angle of the first.
  const Reference way =
      smooth_ramp(distance_rad, over_rad, std::clamp(first.angle_rad - from_rad, 0.0, over_rad));
  const double rate = 1.0 - way.acceleration_rad_s2;
  return {.angle_rad = first.angle_rad - way.speed_rad_s,
          .speed_rad_s = rate * first.speed_rad_s,
          .acceleration_rad_s2 =
              rate * first.acceleration_rad_s2 - way.jerk_rad_s3 * first.speed_rad_s * first.speed_rad_s};
}

TwoPhase voltages_across(const std::array<double, 2>& angles_rad, const std::array<double, 2>& v_q_v,
                         double damping) noexcept {
  const std::array<CosSin, 2> rotor{cos_sin_unbounded(angles_rad[0]), cos_sin_unbounded(angles_rad[1])};
  // A·A' has ones on its diagonal and the cosine of the angle between the rotors beside it.
  const double cross = rotor[0].cos * rotor[1].cos + rotor[0].sin * rotor[1].sin;
  const double diagonal = 1.0 + damping * damping;
  const double scale = std::max(diagonal * diagonal - cross * cross, 1e-12);
  const double first = (diagonal * v_q_v[0] - cross * v_q_v[1]) / scale;
  const double second = (diagonal * v_q_v[1] - cross * v_q_v[0]) / scale;
  return {.a = -rotor[0].sin * first - rotor[1].sin * second,
          .b = rotor[0].cos * first + rotor[1].cos * second};
}

TwoMotorController::TwoMotorController(const TwoMotorParameters& p) noexcept
    : Controller(Quantity::kVoltage, {"second_angle_rad", "second_error_rad", "second_speed_rad_s",
                                      "determinant", "v_q_v", "second_v_q_v", "amplifier_current_a"}),
      p_(p),
      first_(motor_of(p.first)),
      second_(motor_of(p.second)),
      rest_samples_(std::llround(p.rest_s * p.sample_rate_hz)) {}

auto TwoMotorController::motor_of(const PmMachineModel& machine) const noexcept -> Motor {
  return {.machine = machine,
          .shaft = ShaftSensing(p_.counts_per_revolution, p_.speed_observer, machine.friction_rate_per_s(),
                                p_.period_s()),
          .servo = ServoLoop(p_.position, p_.period_s())};
}

void TwoMotorController::Motor::measure(std::int64_t count, std::int64_t periods) noexcept {
  shaft.measure(count, periods, machine.acceleration_per_a() * last_i_q_a);
  electrical_rad = machine.pole_pairs * shaft.disc_rad();
}

double TwoMotorController::wanted_v(Motor& motor, const Reference& r, TwoPhase current_a) const noexcept {
  const PmMachineModel& m = motor.machine;
  const Dq i = to_dq(current_a, cos_sin_unbounded(motor.electrical_rad));
  const double speed_rad_s = motor.shaft.speed_rad_s();
  motor.last_i_q_a = i.q;
  motor.error_rad = r.angle_rad - motor.turned_rad();
  const double acceleration_rad_s2 = motor.servo.acceleration_rad_s2(r, motor.turned_rad(), speed_rad_s);
  const double torque_nm = m.inertia_kgm2 * acceleration_rad_s2 + m.friction_nms * r.speed_rad_s;
  const double i_q_ref_a =
      std::clamp(torque_nm / m.torque_constant_nm_per_a, -p_.current_limit_a, p_.current_limit_a);
  const double emf_v = (m.torque_constant_nm_per_a + m.pole_pairs * m.inductance_h * i.d) * speed_rad_s;
  return m.resistance_ohm * i_q_ref_a + emf_v + p_.current_v_per_a * (i_q_ref_a - i.q);
}

Setpoint TwoMotorController::step(const Measurement& m, const Reference& r, std::int64_t periods) noexcept {
  first_.measure(m.encoder_count, periods);
  second_.measure(m.second.encoder_count, periods);
  const bool rests = rest_samples_ > 0;
  if (rests) {
    rest_samples_ -= periods;
    second_.start_rad = second_.shaft.angle_rad();
  }
  const double determinant = cos_sin_unbounded(second_.electrical_rad - first_.electrical_rad).sin;
  const double near = std::max(1.0 - std::abs(determinant) / p_.near_determinant, 0.0);
  const std::array<double, 2> wanted{
      wanted_v(first_, r, {.a = m.i_a_a, .b = m.i_b_a}),
      wanted_v(second_, p_.fall_back.behind(r), {.a = m.second.i_a_a, .b = m.second.i_b_a})};
  const TwoPhase u =
      voltages_across({first_.electrical_rad, second_.electrical_rad}, wanted, p_.damping * near);
  const TwoPhase given = rests ? TwoPhase{.a = 0.0, .b = 0.0} : shortened(u, p_.voltage_limit_v);
  const bool saturated = !rests && (given.a != u.a || given.b != u.b);
  if (!rests && near == 0.0) {
    first_.servo.integrate();
    second_.servo.integrate();
  }
  const double amplifier_a = std::max(std::abs(m.i_a_a + m.second.i_a_a), std::abs(m.i_b_a + m.second.i_b_a));
  tell({.angle_rad = first_.shaft.angle_rad(),
        .speed_rad_s = first_.shaft.speed_rad_s(),
        .saturated = saturated},
       {second_.turned_rad(), second_.error_rad, second_.shaft.speed_rad_s(), determinant, wanted[0],
        wanted[1], amplifier_a});
  return {.a = given.a, .b = given.b};
}

}  // namespace drivebench::control
