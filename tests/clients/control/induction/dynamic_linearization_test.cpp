#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

#include "clients/control/induction/dynamic_linearization.hpp"
#include "clients/control/induction/voltage_linearization_controller.hpp"
#include "clients/control/math/polynomial.hpp"
#include "tests/clients/control/induction/servo_drive.hpp"

namespace drivebench::control::dynamic_linearization_test {
namespace {

constexpr InductionMachineModel kServo = kServoMotor.machine;
constexpr double kEta = kServo.flux_decay_per_s();
constexpr double kEtaM = kEta * kServo.mutual_inductance_h;
constexpr double kMu = kServo.acceleration_per_wb_a();

// Catches: gains at the wrong power of s, or friction counted twice: with α' = w_q and ω' = α - (f/J)·ω the
// angle error obeys s⁴ + (K3 + f/J)·s³ + (K2 + K3·f/J)·s² + K1·s + K0.
TEST(VoltageLinearization, GainsPlaceBothLoops) {
  const double f = kServo.friction_rate_per_s();
  const VoltageLinearizationParameters p = VoltageLinearizationParameters::placed(250.0, 300.0, f);
  const std::array angle = {p.position_integral_per_s4, p.position_proportional_per_s3,
                            p.position_derivative_per_s2 + p.acceleration_per_s * f, p.acceleration_per_s + f,
                            1.0};
  for (const auto& pole : roots(angle))
    EXPECT_NEAR(std::abs(pole + 250.0), 0.0,
                0.5);  // a fourfold root is found to the fourth root of the rounding
  const std::array flux = {p.flux_integral_per_s3, p.flux_proportional_per_s2, p.flux_derivative_per_s, 1.0};
  for (const auto& pole : roots(flux))
    EXPECT_NEAR(std::abs(pole + 300.0), 0.0, 0.05);
}

// Catches: a flux rate that is left out or has the wrong sign: without feedback, a rising flux and i_q
// flowing, the voltages must bring about the α' and ψ'' that the references ask for by feed-forward.
TEST(VoltageLinearization, LinearisesWhileTheFluxChanges) {
  const VoltageLinearizationParameters no_feedback{};
  InductionDriveParameters drive = kServoDrive;
  drive.motor.machine.friction_nms = 0.0;
  VoltageLinearizationController controller(drive, no_feedback,
                                            {.rated_flux_wb = 0.0455, .base_speed_rad_s = 300.0});
  magnetise(controller, 3.0);
  const Dq i_a = {.d = 4.0, .q = 2.0};
  const Setpoint u = controller.update({.i_a_a = i_a.d, .i_b_a = i_a.q}, {.jerk_rad_s3 = 5e4});
  const double flux_wb = telemetry_of(controller, "flux_wb");
  EXPECT_NEAR(flux_wb, 0.0117 * 3.0, 1e-6);
  const double flux_rate_wb_s = kEtaM * i_a.d - kEta * flux_wb;
  const double slip_rad_s = kEtaM * i_a.q / flux_wb;
  const double gamma = kServoMotor.current_decay_per_s();
  const double sigma_ls = kServoMotor.leakage_inductance_h();
  const double i_d_rate =
      -gamma * i_a.d + kEta * kServoMotor.current_per_wb() * flux_wb + slip_rad_s * i_a.q + u.a / sigma_ls;
  const double i_q_rate = -gamma * i_a.q - slip_rad_s * i_a.d + u.b / sigma_ls;
  EXPECT_FALSE(controller.saturated());
  EXPECT_NEAR(kMu * (flux_rate_wb_s * i_a.q + flux_wb * i_q_rate), 5e4, 1e-3);
  EXPECT_NEAR(kEtaM * i_d_rate - kEta * flux_rate_wb_s, 0.0, 1e-6);
}

// Catches: a wrong term in c': against the difference of c along ψ + ψ'·t + ψ''·t²/2.
TEST(DirectIntegrator, RateOfTheSpeedFactorIsItsDerivative) {
  const double flux_wb = 0.03, rate_wb_s = -0.2, second_wb_s2 = 15.0, h_s = 1e-6;
  InductionMachineModel m = kServo;
  m.friction_nms = 0.01;
  const auto c_at = [&](double t_s) {
    return SpeedFactor::at(m, flux_wb + rate_wb_s * t_s + 0.5 * second_wb_s2 * t_s * t_s,
                           rate_wb_s + second_wb_s2 * t_s, second_wb_s2)
        .c;
  };
  const SpeedFactor factor = SpeedFactor::at(m, flux_wb, rate_wb_s, second_wb_s2);
  EXPECT_NEAR((c_at(h_s) - c_at(-h_s)) / (2.0 * h_s), factor.c_per_s, 1e-5 * std::abs(factor.c_per_s));
}

// Catches: a c that is not the derivative of y: y' = c·ω must be dy/dt of y = ρ - g·ω by the machine's own
// equations, whatever i_q is.
TEST(DirectIntegrator, SpeedFactorBelongsToItsOutput) {
  InductionMachineModel m = kServo;
  m.friction_nms = 0.01;
  const double flux_wb = 0.03, rate_wb_s = -0.2, speed_rad_s = 70.0;
  for (const double i_q_a : {-3.0, 0.0, 5.0}) {
    const double g = kEtaM / (kMu * flux_wb * flux_wb);
    const double g_per_s = -2.0 * g * rate_wb_s / flux_wb;
    const double rho_rad_s = m.pole_pairs * speed_rad_s + kEtaM * i_q_a / flux_wb;
    const double alpha = kMu * flux_wb * i_q_a - m.friction_rate_per_s() * speed_rad_s;
    EXPECT_NEAR(rho_rad_s - g * alpha - g_per_s * speed_rad_s,
                SpeedFactor::at(m, flux_wb, rate_wb_s, 0.0).c * speed_rad_s, 1e-9);
  }
}

// Catches: a singularity at the wrong place: -0.988 Wb/s at rated flux, -0.052 Wb/s at 0.017 Wb, and
// -n_p²·ψ³/(2·J·R_R) in between.
TEST(DirectIntegrator, IsSingularWhenTheFluxFallsTooFast) {
  InductionMachineModel m = kServo;
  m.friction_nms = 0.0;
  for (const auto& [flux_wb, limit_wb_s] : {std::pair{0.0455, -0.988}, std::pair{0.017, -0.0515}}) {
    const double exact_wb_s = -9.0 * flux_wb * flux_wb * flux_wb / (2.0 * 1.1e-4 * 3.9);
    EXPECT_NEAR(exact_wb_s, limit_wb_s, 1e-3);
    EXPECT_NEAR(SpeedFactor::at(m, flux_wb, exact_wb_s, 0.0).c, 0.0, 1e-9);
    EXPECT_GT(SpeedFactor::at(m, flux_wb, 0.9 * exact_wb_s, 0.0).c, 0.0);
  }
}

// Catches: a wrong sign in the 2×2 inverse: in random states the machine's α' and S' must come out as asked
// for.
TEST(QuadratureIntegrator, GivesTheRequestedRates) {
  std::mt19937 random(29);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  for (int k = 0; k < 100; ++k) {
    InductionState x;
    x.flux_wb = 0.03 + 0.02 * any(random);
    x.current_a.q = std::copysign(1.0 + any(random) * 0.9, any(random));
    const double alpha_rate = 1e5 * any(random), slip_rate = 1e3 * any(random);
    const auto [i_d_a, i_q_rate] = quadrature_integrator(kServo, x, alpha_rate, slip_rate);
    const double flux_rate_wb_s = kEtaM * i_d_a - kEta * x.flux_wb;
    EXPECT_NEAR(kMu * (flux_rate_wb_s * x.current_a.q + x.flux_wb * i_q_rate), alpha_rate, 1e-9 * 1e5);
    EXPECT_NEAR(kEtaM * (i_q_rate - x.current_a.q * flux_rate_wb_s / x.flux_wb) / x.flux_wb, slip_rate,
                1e-9 * 1e3);
  }
}

// Catches: a law that does not rest: steady torque needs i_d = ψ/M and a constant i_q.
TEST(QuadratureIntegrator, SteadyOperationTakesTheSteadyCurrents) {
  InductionState x;
  x.flux_wb = 0.0455;
  x.current_a.q = 2.0;
  const QuadratureIntegratorCommand command = quadrature_integrator(kServo, x, 0.0, 0.0);
  EXPECT_NEAR(command.i_d_a, 0.0455 / 0.0117, 1e-12);
  EXPECT_NEAR(command.i_q_rate_a_s, 0.0, 1e-9);
}

// Catches: a singularity that goes unnoticed: without torque the controller says so and asks for finite
// currents.
TEST(QuadratureIntegrator, ReportsASingularityWithoutTorque) {
  QuadratureIntegratorController controller(kServoDrive,
                                            {.current_pole_per_s = 2500.0,
                                             .angle_pole_per_s = 200.0,
                                             .slip_pole_per_s = 200.0,
                                             .load_pole_per_s = 300.0,
                                             .least_i_q_a = 0.3},
                                            {.rated_flux_wb = 0.0455, .base_speed_rad_s = 300.0});
  magnetise(controller, 0.0455 / 0.0117);
  EXPECT_EQ(telemetry_of(controller, "singular"), 1.0);
  EXPECT_NEAR(telemetry_of(controller, "i_d_ref_a"), 0.0455 / 0.0117, 1e-9);
  EXPECT_NEAR(telemetry_of(controller, "i_q_ref_a"), 0.0, 1e-9);
}

// Exercise 30. Catches: a factor in the flat map: its currents and flux, put into the machine's equations,
// give back the torque, the slip and the rate of the flux, and the rate is that of the flux over time.
TEST(FlatInduction, CurrentsAndFluxAreThoseOfTheFlatOutputs) {
  constexpr double kStep_s = 1e-7;
  for (const double slip_rad_s : {100.0, kEta, 700.0}) {
    for (const double rate_nm_s : {-20.0, 0.0, 20.0}) {
      const FlatInductionState x = flat_induction(kServo, slip_rad_s, 0.25, rate_nm_s);
      EXPECT_NEAR(kServo.inertia_kgm2 * kMu * x.flux_wb * x.current_a.q, 0.25, 1e-12);
      EXPECT_NEAR(kEtaM * x.current_a.q / x.flux_wb, slip_rad_s, 1e-9);
      EXPECT_NEAR(kEtaM * x.current_a.d - kEta * x.flux_wb, x.flux_rate_wb_s, 1e-12);
      const FlatInductionState later =
          flat_induction(kServo, slip_rad_s, 0.25 + kStep_s * rate_nm_s, rate_nm_s);
      EXPECT_NEAR((later.flux_wb - x.flux_wb) / kStep_s, x.flux_rate_wb_s, 1e-5);
      EXPECT_NEAR((later.current_a.q - x.current_a.q) / kStep_s, x.i_q_rate_a_s, 1e-2);
    }
  }
}

}  // namespace
}  // namespace drivebench::control::dynamic_linearization_test
