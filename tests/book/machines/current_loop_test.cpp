#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include "tests/book/book_bench.hpp"

namespace drivebench::current_loop_test {
namespace {

using Complex = std::complex<double>;

/// DC-A behind the current amplifier of the bench dc-9-1-4, 40 V and 5 A.
BenchConfig current_driven(double proportional_v_per_a, double integral_v_per_as) {
  BenchConfig config = load_config(std::string(DRIVEBENCH_CONFIGS) + "/benches/dc-9-1-4.toml");
  const BenchConfig motor = load_config(std::string(DRIVEBENCH_CONFIGS) + "/benches/dc-a.toml");
  AxisParameters& p = config.setup.axes[0].parameters;
  p.machine = motor.setup.axes[0].parameters.machine;
  p.mechanics = motor.setup.axes[0].parameters.mechanics;
  p.drive.amplifier.voltage_limit_v = 40.0;
  p.drive.current_loop = {
      .proportional_v_per_a = proportional_v_per_a, .integral_v_per_as = integral_v_per_as, .limit_a = 5.0};
  return config;
}

// AC-04: 1 A is reached and gives KT i/f = 175 rad/s at 14.25 V. 4 A would need 57 V: the amplifier saturates
// after 0.159 s and the motor settles where 40 V take it. 0.2 %. Catches: a current loop with a lasting
// error, one that winds up, a voltage limit that is not kept.
TEST(BookCurrentLoop, TheCurrentAmplifierHoldsOneAmpereAndSaturatesAtFour) {
  for (const double wanted_a : {1.0, 4.0}) {
    BookBench run(current_driven(20.0, 20000.0));
    double saturated_s = 0.0;
    run.control_until(1.5, [&](const Sample& s) -> PhaseCommand {
      if ((s.faults & kVoltageSaturated) != 0 && saturated_s == 0.0 && run.now_s() > 0.01) {
        saturated_s = run.now_s();
      }
      return {.gates = Gates::kCurrent, .setpoint = {.a = wanted_a}};
    });
    const Sample& s = run.sample();
    if (wanted_a == 1.0) {
      EXPECT_NEAR(s.speed_rad_s, 175.0, 0.35);
      EXPECT_NEAR(s.u_a_v, 14.25, 0.03);
      EXPECT_NEAR(s.i_a_a, 1.0, 2e-3);
      EXPECT_EQ(saturated_s, 0.0);
    } else {
      EXPECT_NEAR(saturated_s, 0.15879, 2e-3);
      EXPECT_NEAR(s.speed_rad_s, 491.23, 1.0);
      EXPECT_NEAR(s.i_a_a, 2.807, 0.0056);
      EXPECT_EQ(s.u_a_v, 40.0);
    }
  }
}

constexpr double kPeriod_s = 0.065;  // of the sine, 3250 ticks
constexpr double kSine_rad_s = 2.0 * std::numbers::pi / kPeriod_s;

/// i/i_r at the frequency of the sine, by the transfer function: K_P (s + alpha)(s J + f) over
/// (s (s L + R) + K_P (s + alpha))(s J + f) + s K_T K_b.
Complex transfer(double k_p, double alpha) {
  const Complex s(0.0, kSine_rad_s);
  const Complex shaft = s * 6e-5 + 4e-4;
  const Complex loop = k_p * (s + alpha);
  return loop * shaft / ((s * (s * 2e-3 + 2.0) + loop) * shaft + s * 0.07 * 0.07);
}

/// i/i_r of the amplifier and the motor for a sine of 1 A, from ten periods of the true current.
Complex response(double k_p, double alpha) {
  BenchConfig config = current_driven(k_p, alpha * k_p);
  config.setup.period_ns = 20'000;  // short: hides the steps of the command
  config.setup.substeps = 10;       // and those of the loop
  BookBench run(config);
  Complex sum;
  int count = 0;
  bool saturated = false;
  // The command holds for a tick: its sine is that of the middle of the tick.
  const double middle_s = 0.5 * run.period_s();
  constexpr double kSettled_s = 20 * kPeriod_s;  // the shaft settles within J/f = 0.15 s
  run.control_until(kSettled_s + 10 * kPeriod_s, [&](const Sample& s) -> PhaseCommand {
    const double t = run.now_s();
    if (t > kSettled_s - 0.5 * run.period_s()) {
      sum += s.true_i_a_a * std::polar(1.0, -kSine_rad_s * t);
      ++count;
    }
    saturated = saturated || (s.faults & kVoltageSaturated) != 0;
    return {.gates = Gates::kCurrent, .setpoint = {.a = std::sin(kSine_rad_s * (t + middle_s))}};
  });
  EXPECT_EQ(count, 32'500);
  EXPECT_FALSE(saturated);
  return 2.0 * sum / static_cast<double>(count) * Complex(0.0, 1.0);  // e^(-j pi/2) is the sine itself
}

// AC-05, problem 2.9: 0.5 % and 0.1 degree of the reference, and 2e-4 of the transfer function: the loop
// holds its voltage for 2 us, half of which are 1e-4 rad of the sine. Catches: a
// gain or an integral off by a few parts in a thousand, a current that is delayed by a tick, a back emf that
// the loop does not see.
TEST(BookCurrentLoop, ASineOfOneAmpereFollowsTheTransferFunction) {
  struct Case {
    double k_p, alpha, magnitude, phase_deg;
  };
  for (const Case& c : {Case{20.0, 1000.0, 0.99592, -0.545}, Case{20.0, 0.0, 0.90631, 1.681},
                        Case{10.0, 1000.0, 0.99178, -1.086}, Case{10.0, 0.0, 0.82813, 3.074}}) {
    const Complex measured = response(c.k_p, c.alpha);
    const double phase_deg = std::arg(measured) * 180.0 / std::numbers::pi;
    EXPECT_NEAR(std::abs(measured), c.magnitude, 5e-3 * c.magnitude) << c.k_p << " " << c.alpha;
    EXPECT_NEAR(phase_deg, c.phase_deg, 0.1) << c.k_p << " " << c.alpha;
    EXPECT_NEAR(std::abs(measured - transfer(c.k_p, c.alpha)), 0.0, 2e-4) << c.k_p << " " << c.alpha;
  }
}

// Section 9.1.4, the bench dc-9-1-4 as it is: 22 A turn the motor by K_T i/J = 12 222 rad/s^2, with which not
// even an ideal amplifier does 0.9 pi within 30 ms. While the emf rises the PI loop stays behind by its rate
// over K_I: i = i_r/(1 + K_T^2/(J K_I)), 1e-3 once the start is over. Rise time and lag cost 2.5 % of the
// speed. Catches: a limit of current or voltage that is not kept, a constant or inertia that is not the
// book's.
TEST(BookCurrentLoop, TheMotorOf914CannotFollowTheStepper) {
  BookBench run("dc-9-1-4");
  double largest_a = 0.0;
  const auto current = [&](double amperes) {
    return [&largest_a, amperes](const Sample& s) -> PhaseCommand {
      largest_a = std::max(largest_a, std::abs(s.true_i_a_a));
      return {.gates = Gates::kCurrent, .setpoint = {.a = amperes}};
    };
  };
  run.control_until(0.015, current(22.0));
  constexpr double kIdeal_rad_s = 0.2 * 22.0 / 3.6e-4 * 0.015;
  EXPECT_NEAR(run.sample().speed_rad_s, 0.975 * kIdeal_rad_s, 5e-3 * kIdeal_rad_s);
  EXPECT_NEAR(run.sample().true_i_a_a, 22.0 / (1.0 + 0.2 * 0.2 / (3.6e-4 * 1e4)), 0.022);
  run.control_until(0.030, current(-22.0));
  EXPECT_LT(run.sample().angle_rad, 0.9 * std::numbers::pi);
  EXPECT_NEAR(run.sample().angle_rad, 0.015 * kIdeal_rad_s, 0.05 * 0.015 * kIdeal_rad_s);
  EXPECT_LT(largest_a, 22.0 * 1.05);
  EXPECT_EQ(run.sample().faults & (kOverCurrent | kOverCurrentTrip), 0u);
}

}  // namespace
}  // namespace drivebench::current_loop_test
