#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/book/book_bench.hpp"

namespace drivebench::dc_motor_test {
namespace {

// AC-01, the bench dc-a: 10 V from rest. The closed form is the matrix exponential of the book's equations;
// 0.1 %, the count within one. Catches: a DC source, a constant or an encoder that is not the book's.
TEST(BookDcMotor, TenVoltsFromRestFollowTheClosedForm) {
  BookBench run("dc-a");
  run.run_until(0.5);
  EXPECT_NEAR(run.sample().speed_rad_s, 122.80702, 0.12);
  EXPECT_NEAR(run.sample().i_a_a, 0.701754, 7e-4);
  EXPECT_NEAR(run.sample().angle_rad, 58.800862, 0.0588);
  EXPECT_NEAR(static_cast<double>(run.sample().encoder_count), 18716, 1.0);
}

// AC-01 and AC-02, the same run sampled every 20 us, so that the peak of the current shows (0.1 %) and the
// trapezoidal sums are good to 1e-6: they account for all of the 4.4127 J drawn. Catches: a torque and an emf
// with different constants, friction that the shaft does not feel, a substep that loses energy.
TEST(BookDcMotor, TheEnergyOfTenVoltsIsLostOrStored) {
  BenchConfig config = load_config(std::string(DRIVEBENCH_CONFIGS) + "/benches/dc-a.toml");
  config.setup.period_ns = 20'000;
  config.setup.substeps = 1;
  BookBench run(config);
  double peak_a = 0.0;
  double peak_s = 0.0;
  double drawn_j = 0.0;
  double lost_j = 0.0;
  Sample last = run.sample();
  run.run_until(0.5, [&](const Sample& s) {
    if (s.true_i_a_a > peak_a) {
      peak_a = s.true_i_a_a;
      peak_s = run.now_s();
    }
    const auto sum = [&](auto of) { return 0.5 * run.period_s() * (of(last) + of(s)); };
    drawn_j += sum([](const Sample& x) { return 10.0 * x.true_i_a_a; });
    lost_j += sum([](const Sample& x) {
      return 2.0 * x.true_i_a_a * x.true_i_a_a + 4e-4 * x.speed_rad_s * x.speed_rad_s;
    });
    EXPECT_EQ(s.u_a_v, 10.0);
    last = s;
  });
  EXPECT_NEAR(peak_a, 4.51983, 4.5e-3);
  EXPECT_NEAR(peak_s, 3.412e-3, 20e-6);  // one sample: the peak is flat
  EXPECT_NEAR(drawn_j, 4.4127, 4.4e-3);
  const double stored_j =
      0.5 * (2e-3 * last.true_i_a_a * last.true_i_a_a + 6e-5 * last.speed_rad_s * last.speed_rad_s);
  EXPECT_NEAR(drawn_j, lost_j + stored_j, 1e-5 * drawn_j);
}

// AC-03: at a constant speed the backward difference takes two neighbouring values, less than 2 pi/(N T) from
// the mean speed of the interval. Catches: a count that is rounded instead of cut, a prime mover whose speed
// is not exactly the one imposed.
TEST(BookDcMotor, TheBackwardDifferenceTakesTwoValuesAtConstantSpeed) {
  BenchConfig config = load_config(std::string(DRIVEBENCH_CONFIGS) + "/benches/dc-a.toml");
  AxisParameters& p = config.setup.axes[0].parameters;
  p.mechanics.motion = ShaftMotion::kImposed;
  p.mechanics.imposed_speed_rad_s = 122.807;
  p.drive.source.amplitude_v = 0.0;
  BookBench run(config);
  run.run_until(0.1);
  EXPECT_DOUBLE_EQ(run.sample().speed_rad_s, 122.807);
  constexpr double kCount_rad = 2.0 * std::numbers::pi / 2000.0;
  std::int64_t last = run.sample().encoder_count;
  double last_rad = run.sample().angle_rad;
  Spread backward;
  run.run_until(1.0, [&](const Sample& s) {
    const double speed = static_cast<double>(s.encoder_count - last) * kCount_rad / run.period_s();
    const double mean = (s.angle_rad - last_rad) / run.period_s();
    EXPECT_TRUE(std::abs(speed - 119.381) < 1e-3 || std::abs(speed - 125.664) < 1e-3) << speed;
    EXPECT_LE(std::abs(speed - mean), 6.2832);
    backward.add(speed);
    last = s.encoder_count;
    last_rad = s.angle_rad;
  });
  EXPECT_LT(backward.least, 120.0);
  EXPECT_GT(backward.largest, 125.0);
}

// Of dc-separate and dc-shunt at 220 V and 1 A of field current, k = K_m lambda_f = 0.05 23: friction takes i
// = f w/k, and 220 V = R i + k w.
constexpr double kUnloaded_rad_s = 220.0 / (1.15 + 3.0 * 1e-3 / 1.15);

// DC-06: without its field a separately excited motor runs away. Catches: a loss of field without effect.
TEST(BookDcMotor, WithoutItsFieldASeparatelyExcitedMotorRunsAway) {
  BookBench run("dc-separate");
  run.run_until(4.0);
  const double speed_rad_s = run.sample().speed_rad_s;
  EXPECT_NEAR(speed_rad_s, kUnloaded_rad_s, 1e-6 * kUnloaded_rad_s);
  EXPECT_NEAR(run.sample().i_f_a, 1.0, 1e-3);
  run.bench().submit(
      {.tick = run.bench().tick(), .axis = 0, .owner = 0, .action = fault_of("field_loss", 1.0)});
  run.run_until(4.5);
  EXPECT_GT(run.sample().speed_rad_s, 2.0 * speed_rad_s);  // still rising: 0.5 s after
  EXPECT_NE(run.sample().injected, 0u);
}

// The other DC benches run and reach the values of their equations. Catches: a bench file that does not
// start, a field winding at the wrong terminal.
TEST(BookDcMotor, TheOtherDcBenchesComeToTheirSpeeds) {
  BookBench shunt("dc-shunt");
  shunt.run_until(3.0);
  EXPECT_NEAR(shunt.sample().speed_rad_s, kUnloaded_rad_s, 1e-6 * kUnloaded_rad_s);

  // K_m L_f i^2 = k w^2 + f w and V = (R + R_f) i + K_m L_f i w.
  BookBench series("dc-series");
  series.run_until(8.0);
  const double w = series.sample().speed_rad_s;
  const double i = series.sample().i_a_a;
  EXPECT_NEAR(1.2 * 0.12 * i * i, 1e-4 * w * w + 1e-3 * w, 1e-3 * i * i);
  EXPECT_NEAR(220.0, 2.5 * i + 1.2 * 0.12 * i * w, 0.3);

  // v = (B l/R) V/(B^2 l^2/R + f)
  BookBench linear("linear-dc");
  linear.run_until(30.0);
  EXPECT_NEAR(linear.sample().speed_rad_s, 0.5 * 10.0 / (0.25 + 0.1), 0.01);
}

}  // namespace
}  // namespace drivebench::dc_motor_test
