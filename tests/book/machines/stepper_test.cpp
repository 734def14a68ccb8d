#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

#include "tests/book/book_bench.hpp"

namespace drivebench::stepper_test {
namespace {

constexpr double kDegree_rad = std::numbers::pi / 180.0;

BenchConfig stepper_config() {
  return load_config(std::string(DRIVEBENCH_CONFIGS) + "/benches/pm-stepper.toml");
}

/// Voltages of the n-th half step; every second one has both phases on.
PhaseValues half_step(int n, double volts) {
  constexpr std::array<std::array<double, 2>, 8> kSequence{
      {{1, 0}, {1, 1}, {0, 1}, {-1, 1}, {-1, 0}, {-1, -1}, {0, -1}, {1, -1}}};
  const auto& s = kSequence[static_cast<std::size_t>(n % 8)];
  return {.a = volts * s[0], .b = volts * s[1]};
}

// Case 33: 1.8 degrees a full step, 0.9 a half step, exactly. Catches: a phase order or a number of pole
// pairs that is not the book's.
TEST(BookStepper, StepsAreExact) {
  for (const int stride : {2, 1}) {
    BookBench run(stepper_config());
    for (int n = 0; n <= 8; n += stride) {
      run.control_until(run.now_s() + 0.4, [&](const Sample&) -> PhaseCommand {
        return {.gates = Gates::kVoltage, .setpoint = half_step(n, 3.3)};
      });
      EXPECT_NEAR(run.sample().angle_rad, n * 0.9 * kDegree_rad, 1e-9) << "half step " << n;
    }
  }
}

// Case 33: driven by currents of 1 A the rotor swings to 3.460 degrees at 7.96 ms and rings at 73.0 Hz: only
// a current source leaves the oscillation undamped. 1 %. Catches: a torque or inertia off by a factor, a
// current loop that brakes.
TEST(BookStepper, ACurrentStepRings) {
  BenchConfig config = stepper_config();
  config.setup.period_ns = 20'000;
  config.setup.substeps = 4;
  DriveParameters& drive = config.setup.axes[0].parameters.drive;
  drive.kind = DriveKind::kCurrent;
  drive.amplifier.voltage_limit_v = 1000.0;
  drive.current_loop = {.proportional_v_per_a = 100.0, .integral_v_per_as = 1e5, .limit_a = 6.0};
  BookBench run(config);
  const auto current = [](double a, double b) -> PhaseCommand {
    return {.gates = Gates::kCurrent, .setpoint = {.a = a, .b = b}};
  };
  run.control_until(0.2, [&](const Sample&) { return current(1.0, 0.0); });
  EXPECT_NEAR(run.sample().angle_rad, 0.0, 1e-9);
  const double start_s = run.now_s();
  double peak_rad = 0.0;
  double peak_s = 0.0;
  double last_rad = 0.0;
  std::vector<double> upward_s;
  run.control_until(start_s + 0.5, [&](const Sample& s) {
    const double t = run.now_s() - start_s;
    if (s.angle_rad > peak_rad) {
      peak_rad = s.angle_rad;
      peak_s = t;
    }
    const double rest_rad = 1.8 * kDegree_rad;
    if (last_rad < rest_rad && s.angle_rad >= rest_rad) {
      upward_s.push_back(t - run.period_s() * (s.angle_rad - rest_rad) / (s.angle_rad - last_rad));
    }
    last_rad = s.angle_rad;
    return current(0.0, 1.0);
  });
  EXPECT_NEAR(peak_rad / kDegree_rad, 3.460, 0.0346);
  EXPECT_NEAR(peak_s, 7.96e-3, 8e-5);
  ASSERT_GT(upward_s.size(), 30u);
  const double late_hz = 5.0 / (upward_s.back() - upward_s[upward_s.size() - 6]);
  EXPECT_NEAR(late_hz, 73.0, 0.73);
}

/// Full steps that a train of 40 makes.
long steps_made(double rate_hz, double volts) {
  BookBench run(stepper_config());
  run.control_until(0.3, [&](const Sample&) -> PhaseCommand {
    return {.gates = Gates::kVoltage, .setpoint = half_step(0, volts)};
  });
  const double start_s = run.now_s();
  run.control_until(start_s + 40.0 / rate_hz + 0.5, [&](const Sample&) -> PhaseCommand {
    const int n = std::min(40, static_cast<int>((run.now_s() - start_s) * rate_hz + 1e-9) + 1);
    return {.gates = Gates::kVoltage, .setpoint = half_step(2 * n, volts)};
  });
  return std::lround(run.sample().angle_rad / (1.8 * kDegree_rad));
}

// Case 34: at 1.1 V the motor follows 200 steps a second and falls out of step at 400; it loses whole
// electrical turns, four steps each. Catches: damping that is not the windings' own.
TEST(BookStepper, TheMotorFallsOutOfStepByWholeElectricalTurns) {
  EXPECT_EQ(steps_made(200.0, 1.1), 40);
  const long made = steps_made(400.0, 1.1);
  EXPECT_EQ(made, 4);
  EXPECT_EQ((40 - made) % 4, 0);
}

// The bench stepper: its source steps the motor by itself, 200 steps a second. Catches: a table that is read
// with the wrong period or phase.
TEST(BookStepper, TheSourceOfTheBenchStepsTheMotor) {
  BookBench run("stepper");
  run.run_until(1.0);
  const double before_rad = run.sample().angle_rad;
  run.run_until(2.0);
  EXPECT_NEAR(run.sample().angle_rad - before_rad, 200 * 1.8 * kDegree_rad, 0.2 * kDegree_rad);
}

}  // namespace
}  // namespace drivebench::stepper_test
