#include "clients/identification/motors/bldc_motor.hpp"
#include "clients/identification/identify.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "clients/models/bldc_machine.hpp"
#include "tests/clients/identification/bench_data.hpp"

namespace drivebench::identification::bldc_motor_test {
namespace {

// The motor of chapter 10 on voltages in the shape of its emf, 25 +- 10 V at 7 Hz, true angle, 20 kHz: 1 % of
// the electrical and 2 % of the mechanical parameters, f 5 %. Catches: the sign of e, phases that do not
// follow by 120 degrees, a torque with half its phases.
TEST(BldcMotor, IsIdentifiedFromItsTrapezoids) {
  BenchConfig config = bench_config("bldc-servo");
  set_rate(config, 50'000, 5);
  config.setup.axes[0].parameters.drive.kind = DriveKind::kVoltage;
  BookBench run(config);
  Recorder record(
      {"i_a_a=true_i_a_a", "i_b_a=true_i_b_a", "i_c_a=true_i_c_a", "u_a_v", "u_b_v", "u_c_v", "angle_rad"},
      run.period_s());
  run.control_until(0.5, [&](const Sample& s) {
    const double u = 25.0 + 10.0 * std::sin(2.0 * std::numbers::pi * 7.0 * run.now_s());
    const auto shape = [&](int k) {
      return -u * trapezoid_at_turns(s.angle_rad / (2.0 * std::numbers::pi) - k / 3.0);
    };
    record(s);
    return PhaseCommand{.gates = Gates::kVoltage, .setpoint = {.a = shape(0), .b = shape(1), .c = shape(2)}};
  });
  Settings e{.kind = MotorKind::kBldc, .pole_pairs = 1};
  e.processing = usual_processing(MotorKind::kBldc, run.period_s());
  e.processing.from_s = 0.02;
  Result r = identify_by_equations(record.data(), e);
  r.compare({{"R_S", 0.7}, {"L+M", 2.87e-3}, {"tau_p", 0.5128}, {"J", 2e-4}, {"f", 2e-3}});
  const auto expect = [&](const char* name, double percent) {
    const Estimate& x = *r.find(name);
    EXPECT_NEAR(x.value, *x.truth, 0.01 * percent * *x.truth) << to_markdown(r);
  };
  expect("R_S", 1.0);
  expect("L+M", 1.0);
  expect("tau_p", 1.0);
  expect("J", 2.0);
  expect("f", 5.0);
  EXPECT_TRUE(r.excitation.sufficient) << r.excitation.verdict;
}

// BL-02: the corners at 30, 150, 210, 330 degrees. Catches: a shape that leads by 30 degrees.
TEST(BldcMotor, TheEmfHasItsCorners) {
  const auto at = [](double degrees) { return trapezoid_at_turns(degrees / 360.0); };
  EXPECT_NEAR(at(0.0), 0.0, 1e-12);
  EXPECT_NEAR(at(15.0), 0.5, 1e-12);
  EXPECT_NEAR(at(30.0), 1.0, 1e-12);
  EXPECT_NEAR(at(150.0), 1.0, 1e-12);
  EXPECT_NEAR(at(180.0), 0.0, 1e-12);
  EXPECT_NEAR(at(270.0 - 720.0), -1.0, 1e-12);
}

}  // namespace
}  // namespace drivebench::identification::bldc_motor_test
