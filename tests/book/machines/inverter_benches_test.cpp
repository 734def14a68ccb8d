// The benches behind a switched inverter, as they are shipped.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "tests/book/book_bench.hpp"

namespace drivebench::inverter_benches_test {
namespace {

constexpr double kTwoPi = 2.0 * std::numbers::pi;

/// The motor of bm500.toml, two-phase equivalent.
constexpr double kPolePairs = 4.0;
constexpr double kResistance_ohm = 0.25;
constexpr double kInductance_h = 1.4e-3;
constexpr double kTorqueConstant = 0.162;
constexpr double kInertia_kgm2 = 1.39e-4;

TwoPhase current_of(const Sample& s) {
  return three_to_two({s.i_a_a, s.i_b_a, s.i_c_a});
}

CosSin axes_at(double electrical_rad) {
  return {std::cos(electrical_rad), std::sin(electrical_rad)};
}

PhaseCommand in_axes(Dq v, double electrical_rad) {
  const ThreePhase u = two_to_three(to_ab(v, axes_at(electrical_rad)));
  return {.gates = Gates::kVoltage, .setpoint = {.a = u.a, .b = u.b, .c = u.c}};
}

/// PI control of the currents along and across the field, once a tick; its output holds from the next tick
/// on, so that its middle is one and a half ticks ahead.
class CurrentControl {
 public:
  explicit CurrentControl(double period_s) : period_s_(period_s) {}

  PhaseCommand operator()(const Sample& s, double i_q_a) {
    const double omega = kPolePairs * s.speed_rad_s;
    const double angle = kPolePairs * s.angle_rad;
    const Dq i = to_dq(current_of(s), axes_at(angle));
    constexpr double kProportional = 3.0;
    constexpr double kIntegral = 1500.0;
    const Dq error{-i.d, i_q_a - i.q};
    integral_.d += kIntegral * period_s_ * error.d;
    integral_.q += kIntegral * period_s_ * error.q;
    const Dq v{kProportional * error.d + integral_.d - omega * kInductance_h * i_q_a,
               kProportional * error.q + integral_.q + kTorqueConstant * s.speed_rad_s};
    return in_axes(v, angle + 1.5 * period_s_ * omega);
  }

 private:
  double period_s_;
  Dq integral_{};
};

// Bench bm500 as shipped, 5 A across the field and then -5 A: acceleration and torque are K_m i_q/J and K_m
// i_q (0.3 %: the sampled current is the mean of the period, its ripple makes no torque), encoder and
// resolver follow the shaft, and the braking energy of the shaft is in the capacitor of the link. 1 % of that
// energy: the supply's part is a sum of samples. Catches: an inductance or a torque of the phases instead of
// the two-phase equivalent, a link that the motor does not charge, sensors of another angle.
TEST(BookInverterBenches, TheBm500TurnsCurrentIntoTorqueAndBrakesIntoTheLink) {
  BookBench run("bm500");
  CurrentControl control(run.period_s());
  run.control_until(0.01, [&](const Sample& s) { return control(s, 5.0); });
  const double early_rad_s = run.sample().speed_rad_s;
  Spread torque;
  run.control_until(0.03, [&](const Sample& s) {
    torque.add(s.torque_nm);
    return control(s, 5.0);
  });
  const Sample top = run.sample();
  constexpr double kTorque_nm = kTorqueConstant * 5.0;
  EXPECT_NEAR(torque.mean(), kTorque_nm, 3e-3 * kTorque_nm);
  EXPECT_NEAR((top.speed_rad_s - early_rad_s) / 0.02, kTorque_nm / kInertia_kgm2,
              3e-3 * kTorque_nm / kInertia_kgm2);

  double copper_j = 0.0;
  double supplied_j = 0.0;
  run.control_until(0.05, [&](const Sample& s) {
    const TwoPhase i = current_of(s);
    copper_j += run.period_s() * kResistance_ohm * (i.a * i.a + i.b * i.b);
    supplied_j += run.period_s() * std::max(320.0 - s.bus_voltage_v, 0.0) / 0.5 * s.bus_voltage_v;
    return control(s, -5.0);
  });
  const Sample& s = run.sample();
  const auto kinetic_j = [](const Sample& x) { return 0.5 * kInertia_kgm2 * x.speed_rad_s * x.speed_rad_s; };
  const auto link_j = [](const Sample& x) { return 0.5 * 1e-3 * x.bus_voltage_v * x.bus_voltage_v; };
  const double braked_j = kinetic_j(top) - kinetic_j(s);
  EXPECT_GT(s.bus_voltage_v, 324.0);
  EXPECT_NEAR(link_j(s) - link_j(top), braked_j + supplied_j - copper_j, 0.01 * braked_j);
  EXPECT_EQ(s.faults, 0u);
  EXPECT_EQ(s.encoder_count, static_cast<std::int64_t>(std::floor(s.angle_rad * 8192.0 / kTwoPi)));
  EXPECT_NEAR(s.resolver_sin_v, std::sin(s.angle_rad), 1e-9);
  EXPECT_NEAR(s.resolver_cos_v, std::cos(s.angle_rad), 1e-9);
}

/// Speed of the unloaded bm500 at a voltage across the field.
double no_load_rad_s(double volts, double dead_time_s) {
  BenchConfig config = load_config(std::string(DRIVEBENCH_CONFIGS) + "/benches/bm500.toml");
  config.setup.axes[0].parameters.drive.inverter.dead_time_s = dead_time_s;
  BookBench run(config);
  double ramped_v = 0.0;
  run.control_until(2.0, [&](const Sample& s) {
    ramped_v = std::min(ramped_v + 0.02, volts);
    const double omega = kPolePairs * s.speed_rad_s;
    return in_axes({0.0, ramped_v}, kPolePairs * s.angle_rad + 1.5 * run.period_s() * omega);
  });
  EXPECT_EQ(run.sample().faults, 0u);
  return run.sample().speed_rad_s;
}

// Without load the motor of 9.2.3 runs at u_q/K_m; 0.2 %: while a voltage stands still for a tick the rotor
// turns by up to 0.2 rad. The dead time of the bench, 1 us of 100 at 320 V, is an error of 3.2 V in each leg,
// whose fundamental is 4/pi of that and sqrt(3/2) larger in two phases. Catches: a hexagon or a modulation
// with another gain, a K_m that does not make the emf, a dead time that costs more than it can.
TEST(BookInverterBenches, TheBm500RunsAtItsVoltageOverKm) {
  for (const double volts : {10.0, 20.0, 80.0}) {
    EXPECT_NEAR(no_load_rad_s(volts, 0.0) * kTorqueConstant, volts, 2e-3 * volts);
    const double dead_v = std::sqrt(1.5) * 4.0 / std::numbers::pi * 3.2;
    EXPECT_NEAR(no_load_rad_s(volts, 1e-6) * kTorqueConstant, volts, dead_v) << volts;
  }
}

// AC-26 on the bench bm500: the shaft turned at 300 rad/s with all gates off, no current flows and the
// terminals show v_k = -K w sin(n_p theta - (k-1) 2 pi/3) with K = sqrt(2/3) K_m, which is K_m w (-sin, cos)
// in two phases: its length to 1e-6, its angle to the rotor's turn in a substep. Catches: the signs of
// (7.81), an emf of the wrong axis or size, diodes that conduct against a link of 320 V.
TEST(BookInverterBenches, TheOpenTerminalsOfTheBm500ShowItsEmf) {
  BenchConfig config = load_config(std::string(DRIVEBENCH_CONFIGS) + "/benches/bm500.toml");
  AxisParameters& p = config.setup.axes[0].parameters;
  p.mechanics.motion = ShaftMotion::kImposed;
  p.mechanics.imposed_speed_rad_s = 300.0;
  config.setup.substeps = 50;
  BookBench run(config);
  run.run_until(0.05);
  const double emf_v = kTorqueConstant * 300.0;
  const double substep_rad = kPolePairs * 300.0 * run.period_s() / 50.0;
  run.run_until(0.1, [&](const Sample& s) {
    const Dq v = to_dq(three_to_two({s.u_a_v, s.u_b_v, s.u_c_v}), axes_at(kPolePairs * s.angle_rad));
    ASSERT_DOUBLE_EQ(s.speed_rad_s, 300.0);
    ASSERT_NEAR(std::hypot(v.d, v.q), emf_v, 1e-6 * emf_v);
    ASSERT_NEAR(std::atan2(v.q, v.d), 0.25 * kTwoPi, 1.001 * substep_rad);
    ASSERT_EQ(s.true_i_a_a, 0.0);
    ASSERT_EQ(s.torque_nm, 0.0);
  });
}

/// The book's trapezoid from its printed corners.
double trapezoid_at(double angle_rad) {
  constexpr double kCorner = std::numbers::pi / 6.0;
  const double x = angle_rad - kTwoPi * std::floor(angle_rad / kTwoPi);
  if (x < kCorner) return x / kCorner;
  if (x < 5.0 * kCorner) return 1.0;
  if (x < 7.0 * kCorner) return (6.0 * kCorner - x) / kCorner;
  return x < 11.0 * kCorner ? -1.0 : (x - 12.0 * kCorner) / kCorner;
}

/// Mean speed of the bench bldc-inverter at trapezoids of a duty of the 200 V, in step with the rotor.
double speed_at(double duty, double load_nm) {
  BookBench run("bldc-inverter");
  run.bench().submit(
      {.tick = 0, .axis = 0, .owner = 0, .action = LoadChange{.load_nm = load_nm, .ramp_ticks = 5000}});
  Spread speed;
  Spread current;
  double ramped = 0.0;
  run.control_until(2.0, [&](const Sample& s) -> PhaseCommand {
    ramped = std::min(ramped + 1e-4, duty);
    if (run.now_s() > 1.0) {
      speed.add(s.speed_rad_s);
      current.add(s.true_i_a_a + s.true_i_b_a + s.true_i_c_a);
    }
    constexpr std::array<std::uint64_t, 6> kLines{5, 1, 3, 2, 6, 4};  // from -30 degrees on
    const double sixth = s.angle_rad / (kTwoPi / 6.0) + 0.5;
    const double sector = std::floor(sixth) - 6.0 * std::floor(std::floor(sixth) / 6.0);
    EXPECT_EQ(s.hall_lines, kLines[static_cast<std::size_t>(sector)]);
    const double angle = s.angle_rad + 1.5 * run.period_s() * s.speed_rad_s;
    const auto volts = [&](int k) { return -200.0 * ramped * trapezoid_at(angle - k * kTwoPi / 3.0); };
    return {.gates = Gates::kVoltage, .setpoint = {.a = volts(0), .b = volts(1), .c = volts(2)}};
  });
  EXPECT_NEAR(current.largest - current.least, 0.0, 1e-9);
  EXPECT_EQ(run.sample().faults, 0u);
  return speed.mean();
}

// The bench bldc-inverter as it is. With u_k = -U e_k the quasi-stationary currents of the star are
// (e_p w - U)(e_k - mean e)/R, whose mean torque is tau_p (U - e_p w)/R (sum e^2 - (sum e)^2/3) with
// the means 7/3 and 1/3; friction and load take it. Unloaded the ripple of the currents cancels the dead
// times (0.1 %); 1 N m needs currents that keep their sign, and each leg loses 400 V 1 us/100 us = 4 V (0.5
// %: the inductances of 4 ms are left out). Catches: a neutral that is not removed, an emf of another size, a
// duty of the wrong link, a dead time of the wrong sign or size.
TEST(BookInverterBenches, TheBldcRunsAtItsDuty) {
  const auto expected = [](double volts, double load_nm) {
    const double per_volt = 0.5128 / 0.7 * (7.0 / 3.0 - 1.0 / 9.0);
    return (per_volt * volts - load_nm) / (per_volt * 0.5128 + 0.002);
  };
  EXPECT_NEAR(speed_at(0.15, 0.0), expected(30.0, 0.0), 1e-3 * 58.4);
  EXPECT_NEAR(speed_at(0.15, 1.0), expected(26.0, 1.0), 5e-3 * 49.4);
  EXPECT_NEAR(speed_at(0.50, 1.0), expected(96.0, 1.0), 5e-3 * 185.6);
}

}  // namespace
}  // namespace drivebench::inverter_benches_test
