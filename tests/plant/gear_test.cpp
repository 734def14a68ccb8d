// A rigid shaft with a gear: everything that ShaftState does.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "plant/mechanics/shaft.hpp"
#include "tests/plant/shaft_run.hpp"

namespace drivebench::gear_test {
namespace {

using RigidRun = ShaftRun<ShaftState>;

constexpr double kRatio = 10.0;

/// Example of the reference, DC-10: 8e-5 kg·m^2 and 5e-4 N·m·s/rad at the motor, 0.16 s.
MechanicsParameters reference_train() {
  return {.inertia_kgm2 = 6e-5,
          .viscous_friction_nms = 4e-4,
          .gear_ratio = kRatio,
          .load_inertia_kgm2 = 2e-3,
          .load_viscous_friction_nms = 1e-2};
}

// Catches: inertia or friction divided by n in place of n^2, a load torque that is not divided by n.
// Runge-Kutta errs by (1/160)^4/120 here.
TEST(Gear, TheTrainOfTheReferenceApproachesItsSpeedAsTheClosedFormSays) {
  const ShaftConstants c = constants_of(reference_train());
  EXPECT_NEAR(c.inertia_kgm2, 8e-5, 1e-19);
  EXPECT_NEAR(c.friction_nms, 5e-4, 1e-18);
  RigidRun shaft(reference_train());
  shaft.run(0.16, 160, 0.07, 0.2);
  EXPECT_NEAR(load_side(c, shaft.x(), 0.0).speed_rad_s, 10.0 * (1.0 - std::exp(-1.0)), 1e-9);
  shaft.run(0.16 * 30, 4800, 0.07, 0.2);
  EXPECT_NEAR(shaft.x().speed_rad_s, 100.0, 1e-9);
  EXPECT_NEAR(load_side(c, shaft.x(), 0.0).speed_rad_s, 10.0, 1e-10);
}

// Thrown upwards it comes back with the same speed to the same place, exactly so at constant acceleration.
// Catches: an active load that turns round with the motion.
TEST(Gear, AHangingMassFallsBackAsFastAsItWasThrown) {
  MechanicsParameters p = reference_train();
  p.viscous_friction_nms = p.load_viscous_friction_nms = 0.0;
  constexpr double kWeight_nm = 0.4;
  constexpr double kSpeed_rad_s = 60.0;
  const double back_s = 2.0 * kSpeed_rad_s * 8e-5 * kRatio / kWeight_nm;
  RigidRun shaft(p, {.speed_rad_s = kSpeed_rad_s});
  shaft.run(0.5 * back_s, 50, 0.0, kWeight_nm);
  EXPECT_NEAR(shaft.x().speed_rad_s, 0.0, 1e-11);
  EXPECT_NEAR(shaft.x().angle_rad, 0.25 * kSpeed_rad_s * back_s, 1e-11);
  shaft.run(0.5 * back_s, 50, 0.0, kWeight_nm);
  EXPECT_NEAR(shaft.x().speed_rad_s, -kSpeed_rad_s, 1e-11);
  EXPECT_NEAR(shaft.x().angle_rad, 0.0, 1e-11);
}

// 0.5 N·m at the output are 0.05 at the motor. Catches: a passive load that drives, that does not hold, or
// that holds with n times its torque.
TEST(Gear, APassiveLoadHoldsOpposesAndNeverDrives) {
  MechanicsParameters p = reference_train();
  p.viscous_friction_nms = p.load_viscous_friction_nms = 0.0;
  p.passive_load_nm = 0.5;
  for (const double sign : {1.0, -1.0}) {
    RigidRun shaft(p);
    shaft.run(0.1, 10, sign * 0.05, 0.0);
    EXPECT_EQ(shaft.x().speed_rad_s, 0.0);
    EXPECT_EQ(shaft.x().angle_rad, 0.0);
    shaft.run(0.1, 10, sign * 0.058, 0.0);
    EXPECT_NEAR(shaft.x().speed_rad_s, sign * 0.008 / 8e-5 * 0.1, 1e-11);
    shaft.run(0.1, 10, 0.0, 0.0);  // stops after 16 ms
    EXPECT_EQ(shaft.x().speed_rad_s, 0.0);
    const double angle_rad = shaft.x().angle_rad;
    EXPECT_NEAR(angle_rad, sign * (0.5 * 10.0 * 0.1 + 0.5 * 10.0 * 0.016), 1e-11);
    shaft.run(0.1, 10, 0.0, sign * 0.4);  // an active load below it
    EXPECT_EQ(shaft.x().angle_rad, angle_rad);
    shaft.run(0.1, 10, 0.0, sign * 0.6);  // and above
    EXPECT_NEAR(shaft.x().speed_rad_s, -sign * 0.01 / 8e-5 * 0.1, 1e-11);
  }
}

// Catches: stiction in place of Coulomb friction on a turning shaft, or the other way round, and a passive
// load that is counted in one of them only.
TEST(Gear, AStandingShaftBreaksAwayAboveStictionAndPassiveLoadTogether) {
  MechanicsParameters p = reference_train();
  p.viscous_friction_nms = p.load_viscous_friction_nms = 0.0;
  p.coulomb_friction_nm = 0.01;
  p.static_friction_nm = 0.03;
  p.passive_load_nm = 0.2;
  RigidRun shaft(p);
  shaft.run(0.1, 10, 0.0499, 0.0);
  EXPECT_EQ(shaft.x().speed_rad_s, 0.0);
  shaft.run(0.1, 10, 0.0501, 0.0);
  EXPECT_NEAR(shaft.x().speed_rad_s, (0.0501 - 0.03) / 8e-5 * 0.1, 1e-10);
}

// J w' = tau - k w^2: w = w_end tanh(t/T), w_end = sqrt(tau/k), T = J/sqrt(tau k), where k is that of the
// output over n^3. Catches: another power of n, and a fan that drives when it turns backwards.
TEST(Gear, AFanReachesItsTerminalSpeedAsTheClosedFormSays) {
  MechanicsParameters p = reference_train();
  p.viscous_friction_nms = p.load_viscous_friction_nms = 0.0;
  p.fan_torque_nms2 = 5e-3;
  constexpr double kTorque_nm = 0.05;
  const double k = 5e-3 / (kRatio * kRatio * kRatio);
  const double time_s = 8e-5 / std::sqrt(kTorque_nm * k);
  for (const double sign : {1.0, -1.0}) {
    RigidRun shaft(p);
    shaft.run(time_s, 200, sign * kTorque_nm, 0.0);
    EXPECT_NEAR(shaft.x().speed_rad_s, sign * 100.0 * std::tanh(1.0), 1e-8);  // step (T/200)^4
    shaft.run(20.0 * time_s, 2000, sign * kTorque_nm, 0.0);
    EXPECT_NEAR(shaft.x().speed_rad_s, sign * 100.0, 1e-10);
  }
}

// Catches: an output that forgets whole turns, a lead per radian.
TEST(Gear, TheOutputTurnsNTimesSlowerAndTheTableGoesALeadPerTurn) {
  MechanicsParameters p = reference_train();
  p.screw_lead_m = 0.005;
  constexpr double kTurn_rad = 2.0 * std::numbers::pi;
  const ShaftConstants c = constants_of(p);
  const LoadSide side =
      load_side(c, ShaftState{.speed_rad_s = 30.0, .angle_rad = 0.25 * kTurn_rad}, -15.0 * kTurn_rad);
  EXPECT_NEAR(side.angle_rad, -1.475 * kTurn_rad, 1e-14);
  EXPECT_NEAR(side.speed_rad_s, 3.0, 1e-15);
  EXPECT_NEAR(side.position_m, -1.475 * 0.005, 1e-17);
  EXPECT_EQ(load_side(constants_of(reference_train()), ShaftState{.angle_rad = 1.0}, 0.0).position_m, 0.0);
}

// Catches: a lead per radian in the inertia that the documents give for a table: 12 kg at 4.77 cm/s.
TEST(Gear, ATableOfMassMIsALoadInertiaOfMTimesTheLeadOverTwoPiSquared) {
  constexpr double kMass_kg = 12.0;
  MechanicsParameters p{.gear_ratio = 2.0, .screw_lead_m = 0.01};
  p.load_inertia_kgm2 =
      kMass_kg * (p.screw_lead_m / (2.0 * std::numbers::pi)) * (p.screw_lead_m / (2.0 * std::numbers::pi));
  const ShaftConstants c = constants_of(p);
  const ShaftState x{.speed_rad_s = 60.0};
  const double way_m = load_side(c, ShaftState{.angle_rad = 0.6}, 0.0).position_m;  // in 10 ms
  EXPECT_NEAR(energy_j(c, x), 0.5 * kMass_kg * (way_m / 0.01) * (way_m / 0.01), 1e-16);
}

// Catches: a prime mover that creeps up to its speed, passes it, or yields to torques.
TEST(Gear, APrimeMoverReachesItsSpeedExactlyAtItsAccelerationWhateverTheTorques) {
  MechanicsParameters p = reference_train();
  p.motion = ShaftMotion::kImposed;
  p.imposed_speed_rad_s = -33.3;
  p.imposed_acceleration_rad_s2 = 1000.0;
  p.coulomb_friction_nm = p.static_friction_nm = 5.0;
  RigidRun shaft(p, {.speed_rad_s = 20.0});
  shaft.run(0.04, 7, 3.0, -40.0);
  EXPECT_NEAR(shaft.x().speed_rad_s, -20.0, 1e-13);
  EXPECT_NEAR(shaft.x().angle_rad, 0.0, 1e-14);
  shaft.run(0.06, 7, -3.0, 40.0);  // there after 13.3 ms
  EXPECT_EQ(shaft.x().speed_rad_s, -33.3);
  EXPECT_NEAR(shaft.x().angle_rad, -0.5 * (20.0 + 33.3) * 0.0133 - 33.3 * 0.0467, 1e-14);
  EXPECT_EQ(shaft.branch().acceleration_rad_s2, 0.0);
  EXPECT_EQ(shaft.events(), 1);
}

// Catches: a locked shaft that keeps its speed, turns on, or loses its angle; a lock that does not open.
TEST(Gear, ALockedOrBlockedShaftStandsAtOnceWhereItIs) {
  MechanicsParameters p = reference_train();
  for (const bool fault : {false, true}) {
    p.motion = fault ? ShaftMotion::kImposed : ShaftMotion::kLocked;
    p.imposed_speed_rad_s = 50.0;
    RigidRun shaft(p, {.speed_rad_s = 80.0, .angle_rad = 1.25});
    shaft.blocked = fault;
    shaft.run(0.01, 10, 1.0, -3.0);
    EXPECT_EQ(shaft.x().speed_rad_s, 0.0);
    EXPECT_EQ(shaft.x().angle_rad, 1.25);
    shaft.blocked = false;
    shaft.run(0.01, 10, 1.0, -3.0);
    EXPECT_EQ(shaft.x().speed_rad_s, fault ? 50.0 : 0.0);
  }
}

// Catches: an impulse on the rotor alone where load and rotor are one, or one that moves a prime mover.
TEST(Gear, ABumpChangesTheSpeedByItsImpulseOverTheInertia) {
  MechanicsParameters p = reference_train();
  const ShaftState x{.speed_rad_s = 10.0, .angle_rad = 0.5};
  const ShaftState after = bumped(constants_of(p), x, -4e-4);
  EXPECT_NEAR(after.speed_rad_s, 5.0, 1e-14);
  EXPECT_EQ(after.angle_rad, 0.5);
  for (const ShaftMotion motion : {ShaftMotion::kLocked, ShaftMotion::kImposed}) {
    p.motion = motion;
    EXPECT_EQ(bumped(constants_of(p), x, -4e-4).speed_rad_s, 10.0);
  }
}

// Supplied energy is lost or stored, at every step of a run with every friction and several reversals.
// Catches: a loss that the motion does not feel or a torque that no loss accounts for.
TEST(Gear, TheEnergyBalanceHoldsThroughReversalsWithEveryFriction) {
  MechanicsParameters p = reference_train();
  p.coulomb_friction_nm = 0.004;
  p.static_friction_nm = 0.006;
  p.passive_load_nm = 0.03;
  p.fan_torque_nms2 = 2e-3;
  RigidRun shaft(p, {.speed_rad_s = 50.0});
  const double start_j = energy_j(shaft.constants(), shaft.x());
  for (const double torque_nm : {0.1, -0.2, 0.009, 0.3, -0.05}) {
    for (int k = 0; k < 200; ++k) {
      shaft.step(1e-3, torque_nm, 0.05);
      const double stored_j = energy_j(shaft.constants(), shaft.x()) - start_j;
      // Runge-Kutta at a hundredth of the time constant, on sums of about 2 J.
      ASSERT_NEAR(shaft.supplied_j(), shaft.lost_j() + stored_j, 1e-8);
    }
  }
  EXPECT_GT(shaft.lost_j(), 1.0);
  EXPECT_GE(shaft.events(), 3);
}

// Catches: a branch that the drive train is not told to look for, and a substep chosen for another shaft.
TEST(Gear, MassesEventsAndTimeConstantFollowTheParameters) {
  MechanicsParameters p = reference_train();
  EXPECT_FALSE(has_two_masses(p));
  EXPECT_FALSE(has_events(p));
  EXPECT_NEAR(fastest_time_constant_s(p), 0.16, 1e-15);
  EXPECT_EQ(fastest_time_constant_s({.inertia_kgm2 = 1.0}), std::numeric_limits<double>::infinity());
  for (auto member : {&MechanicsParameters::coulomb_friction_nm, &MechanicsParameters::static_friction_nm,
                      &MechanicsParameters::passive_load_nm}) {
    MechanicsParameters q = p;
    q.*member = 1e-3;
    EXPECT_TRUE(has_events(q));
  }
  for (const ShaftMotion motion : {ShaftMotion::kLocked, ShaftMotion::kImposed}) {
    p.motion = motion;
    EXPECT_TRUE(has_events(p));
  }
}

}  // namespace
}  // namespace drivebench::gear_test
