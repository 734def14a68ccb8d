// The benches pm-9-3 and wound-rotor, as they are shipped.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include "tests/book/book_bench.hpp"

namespace drivebench::synchronous_benches_test {
namespace {

using Complex = std::complex<double>;

constexpr double kTwoPi = 2.0 * std::numbers::pi;

/// The motor and the amplifier of pm-9-3.toml.
constexpr double kPolePairs = 50.0;
constexpr double kResistance_ohm = 0.6;
constexpr double kInductance_h = 2.4e-3;
constexpr double kTorqueConstant = 0.515;
constexpr double kStiction_nm = 0.0693;
constexpr double kFriction_nms = 0.0032;
constexpr double kFilter_s = 1.0 / (kTwoPi * 10e3);

PhaseCommand volts(double a, double b) {
  return {.gates = Gates::kVoltage, .setpoint = {.a = a, .b = b}};
}

// The static test of 9.3 on the bench pm-9-3: along phase a the rotor stays, and the current is the answer of
// R_S and 4 ms to a step that is 1.6 ticks late and has passed the output filter; 1e-6 A. Catches: a delay of
// whole ticks, a filter of another corner, an inductance that is not L_S, a rotor that turns without torque.
TEST(BookSynchronousBenches, TheMotorOf93AnswersAVoltageStepAtStandstill) {
  BookBench run("pm-9-3");
  constexpr double kVolts = 1.5;
  constexpr double kTau_s = kInductance_h / kResistance_ohm;
  const double step_s = 5.0 * run.period_s();
  const auto expected_a = [&](double t) {
    if (t <= 0.0) return 0.0;
    const double past = kTau_s * std::exp(-t / kTau_s) - kFilter_s * std::exp(-t / kFilter_s);
    return kVolts / kResistance_ohm * (1.0 - past / (kTau_s - kFilter_s));
  };
  run.control_until(0.04, [&](const Sample& s) {
    EXPECT_NEAR(s.true_i_a_a, expected_a(run.now_s() - step_s - 1.6 * run.period_s()), 1e-6) << run.now_s();
    return volts(run.now_s() > step_s - 1e-9 ? kVolts : 0.0, 0.0);
  });
  EXPECT_EQ(run.sample().angle_rad, 0.0);
  EXPECT_NEAR(run.sample().true_i_a_a, kVolts / kResistance_ohm, 2e-4);
}

// Across the magnet the shaft breaks away where K_m i_b is the friction; the ramp rises by 2 uV a tick, 1e-4.
// Catches: static friction that does not hold, or of the wrong size.
TEST(BookSynchronousBenches, TheMotorOf93BreaksAwayAtItsStaticFriction) {
  BookBench run("pm-9-3");
  double broke_a = 0.0;
  run.control_until(1.0, [&](const Sample& s) {
    if (broke_a == 0.0 && s.speed_rad_s != 0.0) broke_a = s.true_i_b_a;
    return volts(0.0, 0.1 * run.now_s());
  });
  EXPECT_NEAR(broke_a, kStiction_nm / kTorqueConstant, 1e-4 * broke_a);
  EXPECT_GT(run.sample().angle_rad, 0.0);
}

// With the current along the magnet decoupled away, u_q = R_S i_q + K_m w and K_m i_q = f w + f_c: speed and
// current to 1e-3; half of that are the voltages that stand still for a tick. Catches: a friction that is
// lost while the shaft turns, an emf or a torque without K_m.
TEST(BookSynchronousBenches, TheMotorOf93RunsAgainstItsFriction) {
  for (const double u_q : {3.0, 6.0}) {
    BookBench run("pm-9-3");
    // Delay, half of the tick for which a voltage holds, and the filter.
    const double late_s = 2.1 * run.period_s() + kFilter_s;
    double ramped_v = 0.0;
    run.control_until(1.0, [&](const Sample& s) {
      ramped_v = std::min(ramped_v + 2e-3, u_q);
      const double omega = kPolePairs * s.speed_rad_s;
      const double angle = kPolePairs * s.angle_rad;
      const Dq i = to_dq({s.i_a_a, s.i_b_a}, {std::cos(angle), std::sin(angle)});
      const double ahead = angle + omega * late_s;
      const TwoPhase v = to_ab({-omega * kInductance_h * i.q, ramped_v}, {std::cos(ahead), std::sin(ahead)});
      return volts(v.a, v.b);
    });
    const double expected_rad_s = (u_q - kResistance_ohm * kStiction_nm / kTorqueConstant) /
                                  (kTorqueConstant + kResistance_ohm * kFriction_nms / kTorqueConstant);
    const Sample& s = run.sample();
    EXPECT_NEAR(s.speed_rad_s, expected_rad_s, 1e-3 * expected_rad_s);
    EXPECT_NEAR(s.torque_nm, kFriction_nms * expected_rad_s + kStiction_nm, 1e-3 * s.torque_nm);
  }
}

/// The machine of wound-rotor.toml at 50 Hz.
constexpr double kLine_rad_s = kTwoPi * 50.0;
constexpr double kMutual_h = 0.8;

/// Length of the stator voltages as a two-phase vector.
double voltage_v(const Sample& s) {
  const TwoPhase v = three_to_two({s.u_a_v, s.u_b_v, s.u_c_v});
  return std::hypot(v.a, v.b);
}

// The bench wound-rotor as it is: the field current rises with L_F/R_F = 0.15 s to 40 V/40 ohm while the
// prime mover comes up by 500 rad/s^2, and the open stator shows n_p w M i_F at 50 Hz; the field takes 40 W.
// 1e-6, where all is steady. Catches: an excitation without its resistance, an open stator that carries
// current, a prime mover that slips.
TEST(BookSynchronousBenches, TheWoundRotorGeneratesItsOpenVoltage) {
  BookBench run("wound-rotor");
  run.run_until(0.2);
  EXPECT_NEAR(run.sample().speed_rad_s, 100.0, 1e-9);
  EXPECT_NEAR(run.sample().i_f_a, 1.0 - std::exp(-0.2 / 0.15), 1e-9);
  run.run_until(4.0);
  const double before_rad = run.sample().angle_rad;
  run.run_until(5.0, [](const Sample& s) {
    ASSERT_NEAR(voltage_v(s), kLine_rad_s * kMutual_h * 1.0, 1e-6 * 251.3);
    ASSERT_EQ(s.true_i_a_a, 0.0);
    ASSERT_EQ(s.torque_nm, 0.0);
  });
  EXPECT_NEAR(run.sample().angle_rad - before_rad, 0.5 * kLine_rad_s, 1e-5);  // 157.07963 in the file
  EXPECT_NEAR(run.sample().u_f_v * run.sample().i_f_a, 40.0, 1e-6);
}

// The contactor is closed at four different load angles, and the shaft keeps its synchronous speed: the
// currents and the torque settle at I = (U - j w M i_F e)/(R_S + j w L_S) and tau w = Re(E I*), as a motor or
// a generator, with the field current as before. 1e-4 of the short-circuit current, as the source is followed
// in steps of 50 us. Catches: a contactor that stays open, synchronous reactance or emf of the wrong sign, a
// power that is not delivered to the shaft.
TEST(BookSynchronousBenches, TheWoundRotorOnTheLineFollowsItsPhasorDiagram) {
  double least_nm = 0.0;
  double most_nm = 0.0;
  for (const double ahead_rad : {0.0, 0.4, 2.0, 4.0}) {
    BenchConfig config = load_config(std::string(DRIVEBENCH_CONFIGS) + "/benches/wound-rotor.toml");
    AxisParameters& p = config.setup.axes[0].parameters;
    p.drive.source.phase_rad = ahead_rad;
    config.axes[0].events = {{.tick = 30'000, .action = write_of(p, "source.contactor", 1.0)}};
    BookBench run(config);
    run.run_until(6.0);  // 50 time constants of the stator
    const Sample& s = run.sample();
    const Complex u = std::sqrt(1.5) * std::polar(325.27, kLine_rad_s * run.now_s() + ahead_rad);
    const Complex emf = Complex(0.0, kLine_rad_s * kMutual_h) * std::polar(1.0, 2.0 * s.angle_rad);
    const Complex i = (u - emf) / Complex(2.0, kLine_rad_s * 0.12);
    const TwoPhase measured = three_to_two({s.true_i_a_a, s.true_i_b_a, s.true_i_c_a});
    const double short_a = std::abs(u) / (kLine_rad_s * 0.12);
    EXPECT_NEAR(std::abs(Complex(measured.a, measured.b) - i), 0.0, 1e-4 * short_a) << ahead_rad;
    EXPECT_NEAR(s.true_i_f_a, 1.0, 1e-4) << ahead_rad;
    const double expected_nm = std::real(emf * std::conj(i)) / (0.5 * kLine_rad_s);
    EXPECT_NEAR(s.torque_nm, expected_nm, 1e-4 * 251.3 * short_a / (0.5 * kLine_rad_s)) << ahead_rad;
    least_nm = std::min(least_nm, s.torque_nm);
    most_nm = std::max(most_nm, s.torque_nm);
  }
  EXPECT_LT(least_nm, -5.0);
  EXPECT_GT(most_nm, 5.0);
}

}  // namespace
}  // namespace drivebench::synchronous_benches_test
