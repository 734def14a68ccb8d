#include "plant/math/rk4.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>

#include "tests/plant/servo_axis.hpp"

namespace drivebench::rk4_test {
namespace {

struct Pair {
  double first;
  double second;
};
struct One {
  double only;
};
struct Nested {
  Pair a;
  One b;
  double c;
  Pair d;
};

// Catches: a member of a nested state that is skipped, taken twice or exchanged with another.
TEST(Rk4, EveryMemberOfANestedStateAdvancesByItsOwnSlope) {
  constexpr Nested kState{{1.0, 2.0}, {3.0}, 4.0, {5.0, 6.0}};
  constexpr Nested kSlope{{10.0, 20.0}, {30.0}, 40.0, {50.0, 60.0}};
  constexpr Nested kResult = advanced(kState, 0.5, kSlope);
  EXPECT_EQ(kResult.a.first, 6.0);
  EXPECT_EQ(kResult.a.second, 12.0);
  EXPECT_EQ(kResult.b.only, 18.0);
  EXPECT_EQ(kResult.c, 24.0);
  EXPECT_EQ(kResult.d.first, 30.0);
  EXPECT_EQ(kResult.d.second, 36.0);
}

// x' = 4t^3 makes the step Simpson's rule, which is exact for cubics; y' = y gives the Taylor polynomial of
// degree four. Catches: wrong weights, a stage at the wrong time.
TEST(Rk4, OneStepIsSimpsonsRuleAndTheFourthTaylorPolynomial) {
  struct State {
    double t;
    double x;
    double y;
  };
  const State end = rk4_step(State{1.0, 1.0, 1.0}, 0.5, [](const State& s) -> State {
    return {1.0, 4.0 * s.t * s.t * s.t, s.y};
  });
  EXPECT_NEAR(end.x, 1.5 * 1.5 * 1.5 * 1.5, 1e-14);
  EXPECT_NEAR(end.y, 1.0 + 0.5 + 0.125 + 0.125 / 6.0 + 0.0625 / 24.0, 1e-15);
}

struct DriveState {
  InductionMachineState machine;
  ShaftState shaft;
};

DriveState after_two_milliseconds(int steps) {
  const InductionMachineConstants machine = constants_of(kServoMachine);
  const MechanicsParameters mechanics{.inertia_kgm2 = kServoInertia_kgm2,
                                      .viscous_friction_nms = kServoFriction_nms};
  const ShaftConstants shaft = constants_of(mechanics);
  DriveState x{.machine = {3.0, -2.0, 0.02, 0.03}, .shaft = {.speed_rad_s = 60.0, .angle_rad = 0.5}};
  for (int n = 0; n < steps; ++n) {
    x = rk4_step(x, 2e-3 / steps, [&](const DriveState& s) -> DriveState {
      const RotorMotion motion{s.shaft.angle_rad, s.shaft.speed_rad_s, {1.0, 0.0}};
      return {
          .machine = derivative(machine, s.machine, motion, {.voltage_v = {40.0, -25.0}}),
          .shaft = derivative(shaft, s.shaft, torque_nm(machine, s.machine, motion), 0.05, ShaftBranch{})};
    });
  }
  return x;
}

// The error of a method of order 4 falls by 2^4 when the step halves; at 40 to 10 us the next order of the
// error leaves a few percent. Catches: wrong stage weights, a stage that does not see one of the states
// (order 1 to 3: ratio 2 to 8).
TEST(Rk4, HalvingTheStepDividesTheErrorOfTheMotorBySixteen) {
  const DriveState exact = after_two_milliseconds(6400);
  const auto errors = [&exact](int steps) {
    const DriveState x = after_two_milliseconds(steps);
    return std::array{std::abs(x.machine.i_a_a - exact.machine.i_a_a),
                      std::abs(x.machine.i_b_a - exact.machine.i_b_a),
                      std::abs(x.machine.psi_a_wb - exact.machine.psi_a_wb),
                      std::abs(x.machine.psi_b_wb - exact.machine.psi_b_wb),
                      std::abs(x.shaft.speed_rad_s - exact.shaft.speed_rad_s),
                      std::abs(x.shaft.angle_rad - exact.shaft.angle_rad)};
  };
  const auto coarse = errors(50);
  const auto middle = errors(100);
  const auto fine = errors(200);
  for (std::size_t i = 0; i < coarse.size(); ++i) {
    EXPECT_NEAR(coarse[i] / middle[i], 16.0, 0.8) << "state " << i;
    EXPECT_NEAR(middle[i] / fine[i], 16.0, 0.5) << "state " << i;
  }
}

}  // namespace
}  // namespace drivebench::rk4_test
