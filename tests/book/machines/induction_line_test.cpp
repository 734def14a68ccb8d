#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>

#include "tests/book/book_bench.hpp"

namespace drivebench::induction_line_test {
namespace {

constexpr double kLine_rad_s = 2.0 * std::numbers::pi * 60.0;

/// Largest stator current of a run, two-phase.
double amplitude(const Sample& s) {
  return std::hypot(s.true_i_a_a, s.true_i_b_a);
}

/// Rotor current of im-a seen from the stator, (psi - M i)/L_R, two-phase.
double rotor_a(const Sample& s) {
  return std::hypot(s.psi_a_wb - 0.0117 * s.true_i_a_a, s.psi_b_wb - 0.0117 * s.true_i_b_a) / 0.014;
}

// AC-19, the bench im-a with friction-free 0, 0.2 and 0.5 N m: closed form of the equivalent circuit, 0.1 %;
// the rotor current of the first case is 0 to 1e-3 of the stator's.
// Catches: a two-phase source whose phase b does not follow by a quarter, a load with the wrong sign.
TEST(BookInductionLine, TheTwoPhaseMotorSettlesAtTheSpeedOfItsEquivalentCircuit) {
  struct Case {
    double load_nm, speed_rad_s, current_a, rotor_a;
  };
  for (const Case& c : {Case{0.0, 125.6637, 10.8207, 0.0}, Case{0.2, 120.1217, 10.7072, 0.5331},
                        Case{0.5, 111.232, 10.5982, 1.3602}}) {
    BenchConfig config = load_config(std::string(DRIVEBENCH_CONFIGS) + "/benches/im-a.toml");
    config.axes[0].events = {{.tick = 2500, .action = LoadChange{.load_nm = c.load_nm, .ramp_ticks = 0}}};
    BookBench run(config);
    Spread before;
    run.run_until(0.02, [&](const Sample& s) { before.add(s.speed_rad_s); });
    EXPECT_NEAR(before.largest, 135.0, 1.5);  // it overshoots by 8 %
    run.run_until(1.0);
    EXPECT_NEAR(run.sample().speed_rad_s, c.speed_rad_s, 1e-3 * c.speed_rad_s);
    EXPECT_NEAR(amplitude(run.sample()), c.current_a, 1e-3 * c.current_a);
    EXPECT_NEAR(rotor_a(run.sample()), c.rotor_a, 1e-3 * (c.rotor_a > 0.0 ? c.rotor_a : c.current_a));
    EXPECT_NE(run.sample().faults & kOverCurrent, kOverCurrent);
  }
}

/// A run from the line with the results that AC-22 checks.
struct DirectStart {
  double reached_95_s = 0.0;
  double peak_a = 0.0;
  double peak_nm = 0.0;
  bool over_current = false;
};

// AC-22, the bench im-b: 208 V line to line from rest. Times 2 %, the rest 0.2 %. Catches: a source of line
// instead of phase voltage, a factor sqrt(3/2) lost between phases and two-phase quantities, an over-current
// check of two phases only.
TEST(BookInductionLine, TheThreePhaseMotorStartsFromTheLine) {
  BookBench run("im-b");
  DirectStart start;
  double at_05_s = 0.0;
  run.run_until(2.0, [&](const Sample& s) {
    if (s.speed_rad_s >= 0.95 * 125.6637 && start.reached_95_s == 0.0) start.reached_95_s = run.now_s();
    for (const double i : {s.true_i_a_a, s.true_i_b_a, s.true_i_c_a})
      start.peak_a = std::max(start.peak_a, std::abs(i));
    start.peak_nm = std::max(start.peak_nm, s.torque_nm);
    start.over_current = start.over_current || (s.faults & kOverCurrent) != 0;
    if (std::abs(run.now_s() - 0.5) < 1e-6) at_05_s = s.speed_rad_s;
    ASSERT_NEAR(s.true_i_a_a + s.true_i_b_a + s.true_i_c_a, 0.0, 1e-12);
  });
  EXPECT_NEAR(start.reached_95_s, 0.4720, 0.0094);
  EXPECT_NEAR(at_05_s, 126.19, 0.25);
  EXPECT_NEAR(start.peak_a, 16.69, 0.05);
  EXPECT_NEAR(start.peak_nm, 12.43, 0.04);
  EXPECT_TRUE(start.over_current);
  EXPECT_NEAR(run.sample().speed_rad_s, 125.664, 0.25);
  EXPECT_NEAR(amplitude(run.sample()) > 0.0 ? run.sample().meter_i_rms_a : 0.0, 1.30525, 1.30525 * 2e-3);
}

/// The power analyser's result for the motor im-b on 208 V: impedance per phase and its angle.
struct Reading {
  double voltage_v;
  double current_a;
  double torque_nm;
  std::complex<double> impedance_ohm;
};

Reading measured(bool blocked) {
  BenchConfig config = load_config(std::string(DRIVEBENCH_CONFIGS) + "/benches/im-b.toml");
  AxisParameters& p = config.setup.axes[0].parameters;
  config.setup.substeps = 10;
  if (blocked) {
    p.mechanics.motion = ShaftMotion::kLocked;
  } else {
    p.mechanics.motion = ShaftMotion::kImposed;  // an ideal no-load run: synchronous speed
    p.mechanics.imposed_speed_rad_s = kLine_rad_s / 3.0;
  }
  BookBench run(config);
  run.run_until(3.0);
  const Sample& s = run.sample();
  const double size = s.meter_u_rms_v / s.meter_i_rms_a;
  return {s.meter_u_rms_v, s.meter_i_rms_a, s.torque_nm,
          std::polar(size, std::atan2(s.meter_q_var, s.meter_p_w))};
}

// AC-23: no-load and blocked-rotor test as the book evaluates them. L_S comes out right, R_R 15 % low and
// sigma 3.5 % low: the magnetising branch is left out of the blocked test. 0.3 percentage points. Catches: a
// power analyser that mixes up line and phase, or is wrong by more than 1e-3.
TEST(BookInductionLine, TheNoLoadAndBlockedRotorTestsGiveTheBooksParameters) {
  const Reading no_load = measured(false);
  const Reading blocked = measured(true);
  EXPECT_NEAR(no_load.voltage_v, 208.0 / std::sqrt(3.0), 0.12);
  EXPECT_NEAR(no_load.current_a, 1.30525, 1.3e-3);
  EXPECT_NEAR(blocked.current_a, 8.41017, 8.4e-3);
  EXPECT_NEAR(blocked.torque_nm, 3.0137, 6e-3);  // AC-22, as is the peak of 11.894 A: sqrt(2) times the above
  constexpr double kStator_ohm = 1.85;
  const double stator_h = no_load.impedance_ohm.imag() / kLine_rad_s;
  const double rotor_ohm = blocked.impedance_ohm.real() - kStator_ohm;
  const double leakage_h = blocked.impedance_ohm.imag() / (2.0 * kLine_rad_s);
  const double mutual_h = stator_h - leakage_h;
  const double sigma = 1.0 - mutual_h * mutual_h / (stator_h * stator_h);
  const auto percent = [](double value, double truth) { return 100.0 * (value / truth - 1.0); };
  EXPECT_NEAR(percent(stator_h, 0.244), 0.0, 0.3);
  EXPECT_NEAR(percent(rotor_ohm, 2.1), -15.0, 0.3);
  EXPECT_NEAR(percent(mutual_h, 0.225), 0.30, 0.3);
  EXPECT_NEAR(percent(sigma, 0.149674), -3.47, 0.3);
}

// AC-21, the motor im-b behind three amplifiers, its rotor locked: (100, 0, 0) V lift the neutral to a third,
// the windings see (66.667, -33.333, -33.333) V, and at rest the currents are in that ratio. Catches: a
// neutral that stays at zero or follows the vector, a common voltage that drives a current.
TEST(BookInductionLine, OnePhaseAtHundredVoltsLiftsTheNeutralByAThird) {
  BenchConfig config = load_config(std::string(DRIVEBENCH_CONFIGS) + "/benches/im-b.toml");
  AxisParameters& p = config.setup.axes[0].parameters;
  config.setup.command_delay_ticks = 0;
  p.mechanics.motion = ShaftMotion::kLocked;
  p.drive.kind = DriveKind::kVoltage;
  p.sensors.neutral.enabled = true;
  p.drive.amplifier.over_current_a = 1000.0;
  BookBench run(config);
  run.control_until(5.0, [](const Sample&) -> PhaseCommand {
    return {.gates = Gates::kVoltage, .setpoint = {.a = 100.0}};
  });
  const Sample& s = run.sample();
  EXPECT_NEAR(s.u_n_v, 100.0 / 3.0, 1e-6 * 33.3);
  EXPECT_NEAR(s.u_a_v - s.u_n_v, 200.0 / 3.0, 1e-6 * 66.7);
  EXPECT_NEAR(s.u_b_v - s.u_n_v, -100.0 / 3.0, 1e-6 * 33.3);
  // Direct current after 5 s, some 20 times the slowest time constant of stator and rotor.
  EXPECT_NEAR(s.true_i_a_a, 200.0 / 3.0 / 1.85, 1e-6 * 36.0);
  EXPECT_NEAR(s.true_i_b_a, -100.0 / 3.0 / 1.85, 1e-6 * 36.0);
  EXPECT_NEAR(s.true_i_c_a, -100.0 / 3.0 / 1.85, 1e-6 * 36.0);
}

// AC-25: IM-C on one phase, the other shorted, from synchronous speed under 0.8 N m: mean speed by
// superposition of both rotating fields, 0.2 %; at rest there is no starting torque. Catches: a phase b that
// is connected to the source, a torque at rest.
TEST(BookInductionLine, OnePhaseKeepsTheMotorRunningButDoesNotStartIt) {
  BenchConfig config = load_config(std::string(DRIVEBENCH_CONFIGS) + "/benches/im-c.toml");
  AxisParameters& p = config.setup.axes[0].parameters;
  p.drive.source.start_capacitance_f = 0.0;
  p.drive.source.start_switch = true;
  config.axes[0].events.clear();
  BookBench at_rest(config);
  at_rest.run_until(0.5);
  EXPECT_NEAR(at_rest.sample().speed_rad_s, 0.0, 1e-9);

  p.mechanics.motion = ShaftMotion::kImposed;
  p.mechanics.imposed_speed_rad_s = 188.4956;
  config.axes[0].events = {{.tick = 10'000, .action = write_of(p, "mechanics.motion", 0.0)},
                           {.tick = 10'000, .action = LoadChange{.load_nm = 0.8, .ramp_ticks = 0}}};
  BookBench run(config);
  run.run_until(9.0);
  Spread speed;
  Spread torque;
  double square_a = 0.0;
  double square_b = 0.0;
  run.run_until(10.0, [&](const Sample& s) {
    speed.add(s.speed_rad_s);
    torque.add(s.torque_nm);
    square_a += s.true_i_a_a * s.true_i_a_a;
    square_b += s.true_i_b_a * s.true_i_b_a;
  });
  EXPECT_NEAR(speed.mean(), 184.31, 0.37);
  EXPECT_NEAR(speed.largest - speed.least, 1.08, 0.05);
  EXPECT_NEAR(torque.mean(), 0.8, 2e-3);
  EXPECT_NEAR(torque.largest, 4.88, 0.1);
  EXPECT_NEAR(torque.least, -3.28, 0.1);
  EXPECT_NEAR(std::sqrt(square_a / speed.count), 10.15, 0.05);
  EXPECT_NEAR(std::sqrt(square_b / speed.count), 6.41, 0.05);
}

// P3-12, the bench im-c as shipped: the capacitor makes the current of phase b lead, so that the motor turns
// from b to a; the switch shorts phase b near synchronism, and the motor keeps running under 0.8 N m.
// Catches: a capacitor that gives no phase shift or the wrong one, a switch that does nothing.
TEST(BookInductionLine, TheCapacitorStartsTheSinglePhaseMotor) {
  BookBench run("im-c");
  run.run_until(0.2);
  EXPECT_LT(run.sample().speed_rad_s, -2.0);
  run.run_until(11.9);
  EXPECT_LT(run.sample().speed_rad_s, -150.0);
  run.run_until(18.0);
  Spread speed;
  run.run_until(19.0, [&](const Sample& s) { speed.add(s.speed_rad_s); });
  EXPECT_NEAR(speed.mean(), -184.31, 0.4);
}

// The starts of 8.5.5 and 8.5.6. Catches: an amplitude that is not the one declared.
TEST(BookInductionLine, TheMotorsOfTheIdentificationStartAsInTheBook) {
  BookBench first("im-8-5-5");
  Spread speed;
  Spread current;
  double reached_140_s = 0.0;
  first.run_until(0.2, [&](const Sample& s) {
    speed.add(s.speed_rad_s);
    current.add(amplitude(s));
    if (s.speed_rad_s > 140.0 && reached_140_s == 0.0) reached_140_s = first.now_s();
  });
  EXPECT_NEAR(speed.least, -1.07, 0.05);
  EXPECT_NEAR(reached_140_s, 0.109, 0.001);
  EXPECT_NEAR(first.sample().speed_rad_s, 152.9, 0.3);

  BookBench second("im-8-5-6");
  double reached_180_s = 0.0;
  double most = 0.0;
  second.run_until(1.0, [&](const Sample& s) {
    if (s.speed_rad_s > 180.0 && reached_180_s == 0.0) reached_180_s = second.now_s();
    most = std::max(most, s.speed_rad_s);
  });
  EXPECT_NEAR(reached_180_s, 0.0865, 0.0015);
  EXPECT_NEAR(most, 196.5, 0.4);
}

}  // namespace
}  // namespace drivebench::induction_line_test
