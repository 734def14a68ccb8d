#include "clients/control/induction/induction_drive.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "plant/math/unbounded.hpp"
#include "tests/clients/control/induction/servo_drive.hpp"

namespace drivebench::control::decoupled_current_loop_test {
namespace {

/// Rates of the stator currents in the stator frame, (8.3)-(8.6) written out.
TwoPhase current_rates(const InductionMotorModel& motor, TwoPhase i, TwoPhase psi, double speed_rad_s,
                       TwoPhase u) {
  const double sigma_ls = motor.leakage_inductance_h();
  const double eta_beta = motor.machine.flux_decay_per_s() * motor.current_per_wb();
  const double beta_w = motor.current_per_wb() * motor.machine.pole_pairs * speed_rad_s;
  const double gamma = motor.current_decay_per_s();
  return {.a = eta_beta * psi.a + beta_w * psi.b - gamma * i.a + u.a / sigma_ls,
          .b = eta_beta * psi.b - beta_w * psi.a - gamma * i.b + u.b / sigma_ls};
}

// Catches: any wrong sign or factor of the decoupling: in random states the machine's own equations, in the
// other frame, must answer with exactly the rates that were asked for.
TEST(DecoupledVoltage, GivesTheRequestedRates) {
  std::mt19937 random(8);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  const InductionMachineModel& m = kServoMotor.machine;
  for (int k = 0; k < 100; ++k) {
    InductionState x;
    x.speed_rad_s = 800.0 * any(random);
    x.flux_wb = 0.03 + 0.02 * any(random);
    x.flux_angle_rad = 3.0 * any(random);
    x.flux = cos_sin_unbounded(x.flux_angle_rad);
    x.current_a = {.d = 6.0 * any(random), .q = 6.0 * any(random)};
    const Dq wanted = {.d = 1e4 * any(random), .q = 1e4 * any(random)};

    const TwoPhase u = to_ab(decoupled_voltage_v(kServoMotor, x, wanted), x.flux);
    const TwoPhase rates = current_rates(kServoMotor, to_ab(x.current_a, x.flux),
                                         to_ab({.d = x.flux_wb, .q = 0.0}, x.flux), x.speed_rad_s, u);
    const Dq seen = to_dq(rates, x.flux);
    const double flux_speed_rad_s = m.pole_pairs * x.speed_rad_s +
                                    m.flux_decay_per_s() * m.mutual_inductance_h * x.current_a.q / x.flux_wb;
    EXPECT_NEAR(seen.d + flux_speed_rad_s * x.current_a.q, wanted.d, 1e-8 * 1e4);
    EXPECT_NEAR(seen.q - flux_speed_rad_s * x.current_a.d, wanted.q, 1e-8 * 1e4);
  }
}

// Catches: voltages that lag: the middle of the period they are held in is where they belong.
TEST(HeldVoltage, IsTurnedHalfAPeriodAheadAndLimitedPerPhase) {
  InductionState x;
  x.speed_rad_s = 800.0;  // 0.15 rad in half a period
  const PhaseVoltages free = held_voltage(kServoDrive, x, {.d = 10.0, .q = 0.0});
  EXPECT_NEAR(std::atan2(free.voltage_v.b, free.voltage_v.a), 0.5 * 125e-6 * 3.0 * 800.0, 1e-12);
  EXPECT_FALSE(free.saturated);
  const PhaseVoltages limited = held_voltage(kServoDrive, x, {.d = 100.0, .q = 0.0});
  EXPECT_EQ(limited.voltage_v.a, 80.0);
  EXPECT_TRUE(limited.saturated);
}

// Catches: an error with the wrong sign: an ampere missing on one axis adds σ·L_S·p volts there and nothing
// elsewhere.
TEST(DecoupledCurrentLoop, AddsTheErrorTimesItsPole) {
  const DecoupledCurrentLoop loop(kServoDrive, 2500.0);
  InductionState x;
  x.flux_wb = 0.0455;
  x.current_a = {.d = 4.0, .q = 0.0};
  const PhaseVoltages at_reference = loop.step(x, {.d = 4.0, .q = 0.0}, {.d = 0.0, .q = 0.0});
  const PhaseVoltages missing = loop.step(x, {.d = 4.0, .q = 1.0}, {.d = 0.0, .q = 0.0});
  EXPECT_NEAR(missing.voltage_v.b - at_reference.voltage_v.b, kServoMotor.leakage_inductance_h() * 2500.0,
              1e-9);
  EXPECT_EQ(missing.voltage_v.a, at_reference.voltage_v.a);
}

}  // namespace
}  // namespace drivebench::control::decoupled_current_loop_test
