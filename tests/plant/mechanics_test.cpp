// The motor has no flux and its terminals are shorted here, so that the shaft sees load and friction only.
#include "plant/mechanics/shaft.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "plant/mechanics/load.hpp"
#include "tests/plant/servo_axis.hpp"

namespace drivebench::mechanics_test {
namespace {

constexpr PhaseCommand kShorted{.gates = Gates::kZeroVoltage, .setpoint = {}};
constexpr double kInertia_kgm2 = 2e-4;
constexpr double kCoulomb_nm = 0.02;
constexpr double kStatic_nm = 0.05;

Axis shaft_with(double viscous_nms, double coulomb_nm, double static_nm) {
  AxisParameters p = servo_axis();
  p.mechanics = {.inertia_kgm2 = kInertia_kgm2,
                 .viscous_friction_nms = viscous_nms,
                 .coulomb_friction_nm = coulomb_nm,
                 .static_friction_nm = static_nm};
  return {p, kServoTiming, 1, 0};
}

Sample run(Axis& axis, Tick from, Tick to) {
  for (Tick tick = from; tick < to; ++tick)
    axis.advance(kShorted, tick);
  return axis.sample(to);
}

// Catches: friction that pushes, stiction that holds above its limit or lets go below it.
TEST(Mechanics, TheFrictionBranchFollowsTheMotionAndAtRestTheDrivingTorque) {
  const ShaftConstants c = constants_of(MechanicsParameters{
      .inertia_kgm2 = 1.0, .coulomb_friction_nm = kCoulomb_nm, .static_friction_nm = kStatic_nm});
  const auto branch = [&c](double speed_rad_s, double torque_nm, double load_nm) {
    return branch_of(c, ShaftState{.speed_rad_s = speed_rad_s}, torque_nm, load_nm, false);
  };
  EXPECT_EQ(branch(1e-12, -9.0, 0.0).direction, 1.0);
  EXPECT_EQ(branch(-1e-12, 9.0, 0.0).direction, -1.0);
  EXPECT_EQ(branch(0.0, kStatic_nm, 0.0).turns, 0.0);
  EXPECT_EQ(branch(-0.0, 0.0, kStatic_nm).turns, 0.0);
  EXPECT_EQ(branch(0.0, 0.0501, 0.0).turns, 1.0);
  EXPECT_EQ(branch(0.0, 0.0501, 0.0).direction, 1.0);
  EXPECT_EQ(branch(0.0, 0.0, 0.0501).direction, -1.0);
  EXPECT_NEAR(derivative(c, ShaftState{.speed_rad_s = 3.0}, 0.7, 0.2, {.direction = 1.0}).speed_rad_s,
              0.7 - 0.2 - kCoulomb_nm, 1e-15);
}

// w = w0 exp(-f t/J). Catches: a wrong factor of the viscous friction.
TEST(Mechanics, ViscousFrictionSlowsExponentially) {
  Axis axis = shaft_with(1e-3, 0.0, 0.0);
  spin(axis, 80.0);
  const Sample s = run(axis, 0, 800);  // 0.1 s, half a time constant
  EXPECT_NEAR(s.speed_rad_s, 80.0 * std::exp(-0.5), 1e-9);
  EXPECT_NEAR(s.angle_rad, 80.0 * 0.2 * (1.0 - std::exp(-0.5)), 1e-9);
}

// Catches: stiction that is only Coulomb friction, breakaway in the wrong direction, Coulomb friction that
// keeps the static value once the shaft turns.
TEST(Mechanics, AShaftBreaksAwayOnlyAboveTheStaticFriction) {
  for (const double sign : {1.0, -1.0}) {
    Axis axis = shaft_with(0.0, kCoulomb_nm, kStatic_nm);
    axis.set_load(-sign * kStatic_nm, 0, 0);
    Sample s = run(axis, 0, 2000);
    EXPECT_EQ(s.speed_rad_s, 0.0);
    EXPECT_EQ(s.angle_rad, 0.0);
    EXPECT_EQ(s.faults, kShaftHeld);
    constexpr double kLoad_nm = 0.0501;
    axis.set_load(-sign * kLoad_nm, 2000, 0);
    s = run(axis, 2000, 2080);  // 10 ms
    EXPECT_NEAR(s.speed_rad_s, sign * (kLoad_nm - kCoulomb_nm) / kInertia_kgm2 * 0.01, 1e-11);
    EXPECT_EQ(s.faults, 0u);
  }
}

/// A DC motor whose current rises towards V/R while static friction holds its shaft.
class HeldMotor {
 public:
  static constexpr double kResistance_ohm = 1.0;
  static constexpr double kInductance_h = 1e-3;
  static constexpr double kTorque_nm_per_a = 0.1;

  explicit HeldMotor(double volts) : volts_(volts) {}

  /// Speed of the shaft after this time in ticks of 1 ms. The equations are linear from the breakaway on:
  ///   w = w_ss + A1 exp(s1 t) + A2 exp(s2 t),  s^2 + R/L s + K^2/(L J) = 0,
  /// with w(0) = 0 and J w'(0) = tau_S - tau_C.
  double exact_rad_s(double time_s) const {
    const double decay_per_s = kResistance_ohm / kInductance_h;
    const double breakaway_s =
        -std::log(1.0 - kStatic_nm * kResistance_ohm / (kTorque_nm_per_a * volts_)) / decay_per_s;
    const double steady_rad_s =
        (volts_ - kResistance_ohm * kCoulomb_nm / kTorque_nm_per_a) / kTorque_nm_per_a;
    const double square = kTorque_nm_per_a * kTorque_nm_per_a / (kInductance_h * kInertia_kgm2);
    const double root = std::sqrt(0.25 * decay_per_s * decay_per_s - square);
    const double s1 = -0.5 * decay_per_s + root;
    const double s2 = -0.5 * decay_per_s - root;
    const double a1 = ((kStatic_nm - kCoulomb_nm) / kInertia_kgm2 + s2 * steady_rad_s) / (s1 - s2);
    const double a2 = -steady_rad_s - a1;
    const double t = time_s - breakaway_s;
    return steady_rad_s + a1 * std::exp(s1 * t) + a2 * std::exp(s2 * t);
  }
  /// The same in a direction, on the axis in substeps of 50 us.
  double speed_rad_s(double sign) const {
    AxisParameters p;
    p.machine = PmDcMachineParameters{.armature_resistance_ohm = kResistance_ohm,
                                      .armature_inductance_h = kInductance_h,
                                      .torque_constant_nm_per_a = kTorque_nm_per_a};
    p.mechanics = {
        .inertia_kgm2 = kInertia_kgm2, .coulomb_friction_nm = kCoulomb_nm, .static_friction_nm = kStatic_nm};
    p.drive.amplifier = {.voltage_limit_v = 100.0, .over_current_a = 100.0};
    Axis axis(p, {.period_s = 1e-3, .substeps = 20}, 1, 0);
    axis.advance({.gates = Gates::kVoltage, .setpoint = {.a = sign * volts_}}, 0);
    return sign * axis.sample(1).speed_rad_s;
  }

 private:
  double volts_;
};

// The torque passes the static friction within a substep, at another part of it for each voltage; RK4 in
// steps of a twentieth of L/R errs by 1e-8 rad/s. Catches: a breakaway that waits for the end of its substep
// (up to 0.02 rad/s here), or that is found and held again.
TEST(Mechanics, TheBreakawayIsLocatedWithinTheSubstep) {
  for (const double volts : {1.0, 1.37, 2.0, 2.71, 5.0, 9.9}) {
    const HeldMotor motor(volts);
    for (const double sign : {1.0, -1.0})
      EXPECT_NEAR(motor.speed_rad_s(sign), motor.exact_rad_s(1e-3), 1e-6) << volts;
  }
}

// From w0 the shaft stops after J w0/tau_C, having turned J w0^2/(2 tau_C). Catches: a stop that is missed,
// chatters or creeps, a stop at the end of the substep in place of its instant.
TEST(Mechanics, CoulombFrictionStopsTheShaftAtTheClosedFormTimeAndAngleAndHoldsIt) {
  constexpr double kSpeed_rad_s = 7.7;
  const double stop_s = kInertia_kgm2 * kSpeed_rad_s / kCoulomb_nm;  // 77 ms = 616 ticks
  for (const double sign : {1.0, -1.0}) {
    Axis axis = shaft_with(0.0, kCoulomb_nm, kStatic_nm);
    spin(axis, sign * kSpeed_rad_s);
    Sample s = run(axis, 0, 615);
    EXPECT_NEAR(s.speed_rad_s, sign * kCoulomb_nm / kInertia_kgm2 * (stop_s - 615 * kServoTick_s), 1e-11);
    EXPECT_EQ(s.faults & kShaftHeld, 0u);
    s = run(axis, 615, 617);
    EXPECT_EQ(s.speed_rad_s, 0.0);
    EXPECT_EQ(s.faults, kShaftHeld);
    const double angle_rad = s.angle_rad;
    EXPECT_NEAR(angle_rad, sign * 0.5 * kSpeed_rad_s * stop_s, 1e-11);
    s = run(axis, 617, 10'000);
    EXPECT_EQ(s.angle_rad, angle_rad);
    EXPECT_EQ(s.speed_rad_s, 0.0);
  }
}

// With viscous friction f the speed crosses zero in a curve, after (J/f) log(1 + f w0/tau_C). Catches: a stop
// that leaves the remainder of the estimated crossing in the speed.
TEST(Mechanics, BothFrictionsTogetherStopTheShaftAtExactlyZero) {
  constexpr double kViscous_nms = 4e-3;
  constexpr double kSpeed_rad_s = 30.0;
  Axis axis = shaft_with(kViscous_nms, kCoulomb_nm, kStatic_nm);
  spin(axis, kSpeed_rad_s);
  Tick tick = 0;
  while (axis.state().shaft.speed_rad_s != 0.0 && tick < 10'000) {
    ASSERT_GT(axis.state().shaft.speed_rad_s, 0.0);
    axis.advance(kShorted, tick++);
  }
  const double time_constant_s = kInertia_kgm2 / kViscous_nms;
  const double stop_s = time_constant_s * std::log(1.0 + kViscous_nms * kSpeed_rad_s / kCoulomb_nm);
  EXPECT_EQ(tick, static_cast<Tick>(std::ceil(stop_s / kServoTick_s)));
  EXPECT_NEAR(axis.sample(tick).angle_rad,
              time_constant_s * (kSpeed_rad_s - kCoulomb_nm / kInertia_kgm2 * stop_s), 1e-9);
  ASSERT_EQ(axis.last_tick().size(), 6u);
}

// Catches: a stop that falls within a substep and is only seen at its end; 0.4 of a substep here.
TEST(Mechanics, TheStopIsLocatedWithinTheSubstep) {
  Axis axis = shaft_with(0.0, kCoulomb_nm, kStatic_nm);
  constexpr double kStop_s = 35e-6;
  constexpr double kSpeed_rad_s = kStop_s * kCoulomb_nm / kInertia_kgm2;
  spin(axis, kSpeed_rad_s, 1.0);
  EXPECT_NEAR(run(axis, 0, 1).angle_rad, 1.0 + 0.5 * kSpeed_rad_s * kStop_s, 1e-15);
  ASSERT_EQ(axis.last_tick().size(), 6u);  // five substeps, one cut in two
  EXPECT_NEAR(axis.last_tick()[1].duration_s, 10e-6, 1e-15);
  EXPECT_EQ(axis.last_tick()[1].end_rad_s, 0.0);
}

// An opposing load above the static friction turns the shaft round: decelerated by load and friction, then
// accelerated by load less friction. Below it the shaft stops and stays. Catches: friction that keeps its old
// direction after the reversal.
TEST(Mechanics, AnOpposingLoadReversesTheShaftOnlyIfItExceedsTheStaticFriction) {
  constexpr double kSpeed_rad_s = 5.0;
  for (const double load_nm : {0.045, 0.08}) {
    Axis axis = shaft_with(0.0, kCoulomb_nm, kStatic_nm);
    spin(axis, kSpeed_rad_s);
    axis.set_load(load_nm, 0, 0);
    const Sample s = run(axis, 0, 400);
    const double stop_s = kInertia_kgm2 * kSpeed_rad_s / (load_nm + kCoulomb_nm);
    const double back_s = 400 * kServoTick_s - stop_s;
    const double back_rad_s2 = load_nm > kStatic_nm ? (load_nm - kCoulomb_nm) / kInertia_kgm2 : 0.0;
    EXPECT_NEAR(s.speed_rad_s, -back_rad_s2 * back_s, 1e-10);
    EXPECT_NEAR(s.angle_rad, 0.5 * kSpeed_rad_s * stop_s - 0.5 * back_rad_s2 * back_s * back_s, 1e-10);
    EXPECT_EQ(s.faults, load_nm > kStatic_nm ? 0u : kShaftHeld);
  }
}

// Catches: a step that acts a tick early or late.
TEST(Mechanics, ALoadStepActsFromItsTickOn) {
  LoadTorque load;
  EXPECT_EQ(load.at(0), 0.0);
  load.go_to(0.3, 50, 0);
  EXPECT_EQ(load.at(50), 0.3);
  EXPECT_EQ(load.at(1'000'000), 0.3);

  Axis axis = shaft_with(0.0, 0.0, 0.0);
  run(axis, 0, 50);
  EXPECT_EQ(axis.sample(50).speed_rad_s, 0.0);
  axis.set_load(0.3, 50, 0);
  EXPECT_NEAR(run(axis, 50, 51).speed_rad_s, -0.3 / kInertia_kgm2 * kServoTick_s, 1e-12);
}

// Catches: a ramp that starts from zero, ends a tick early or late, or jumps when it is replaced on the way.
TEST(Mechanics, ALoadRampGoesFromThePresentValueToTheTargetInItsTicks) {
  LoadTorque load;
  load.go_to(0.2, 0, 0);
  load.go_to(1.0, 100, 40);
  EXPECT_EQ(load.at(100), 0.2);
  EXPECT_NEAR(load.at(110), 0.4, 1e-15);
  EXPECT_NEAR(load.at(139), 0.98, 1e-15);
  EXPECT_EQ(load.at(140), 1.0);
  EXPECT_EQ(load.at(141), 1.0);
  load.go_to(1.0, 200, 0);
  load.go_to(0.0, 300, 10);
  load.go_to(1.0, 305, 5);  // replaces it half way
  EXPECT_NEAR(load.at(305), 0.5, 1e-15);
  EXPECT_NEAR(load.at(306), 0.6, 1e-15);
  EXPECT_EQ(load.at(310), 1.0);
}

}  // namespace
}  // namespace drivebench::mechanics_test
