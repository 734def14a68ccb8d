// Rotor and load on an elastic shaft: everything that TwoMassState does.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>

#include "plant/mechanics/shaft.hpp"
#include "tests/plant/shaft_run.hpp"

namespace drivebench::two_mass_test {
namespace {

using ElasticRun = ShaftRun<TwoMassState>;

constexpr double kRatio = 4.0;
constexpr double kRotor_kgm2 = 1e-4;
constexpr double kLoad_kgm2 = 4e-3;
constexpr double kStiffness_nm = 50.0;
constexpr double kMobility = 1.0 / (kRatio * kRatio * kRotor_kgm2) + 1.0 / kLoad_kgm2;  // 875 per kg·m^2
constexpr double kPlay_rad = 0.02;

/// Without friction; 209 rad/s.
MechanicsParameters elastic_train(double damping_nms, double backlash_rad) {
  return {.inertia_kgm2 = kRotor_kgm2,
          .gear_ratio = kRatio,
          .load_inertia_kgm2 = kLoad_kgm2,
          .shaft_stiffness_nm = kStiffness_nm,
          .shaft_damping_nms = damping_nms,
          .backlash_rad = backlash_rad};
}

/// The load turns at load_rad_s and the shaft is being twisted at twist_rad_s.
TwoMassState moving(double load_rad_s, double twist_rad_s, double twist_rad) {
  return {.speed_rad_s = kRatio * (load_rad_s + twist_rad_s),
          .load_speed_rad_s = load_rad_s,
          .twist_rad = twist_rad};
}

double twist_speed_rad_s(const TwoMassState& x) {
  return x.speed_rad_s / kRatio - x.load_speed_rad_s;
}

/// n J1 w1 + J2 w2, which the shaft cannot change.
double momentum_nms(const TwoMassState& x) {
  return kRatio * kRotor_kgm2 * x.speed_rad_s + kLoad_kgm2 * x.load_speed_rad_s;
}

double frequency_rad_s(double damping_nms) {
  const double decay_per_s = 0.5 * damping_nms * kMobility;
  return std::sqrt(kStiffness_nm * kMobility - decay_per_s * decay_per_s);
}

// twist = x0 exp(-d t) (cos w t + d/w sin w t) with d = D m/2, w^2 = K m - d^2, m = 1/(n^2 J1) + 1/J2.
// Catches: a wrong power of n in the reaction on the rotor, a wrong sign of the damping. Runge-Kutta at w h =
// 0.02 errs by 1e-7 of the amplitude after 20 periods.
TEST(TwoMass, TheTwistVibratesAsTheClosedFormSays) {
  constexpr double kDamping_nms = 2e-3;
  const double d = 0.5 * kDamping_nms * kMobility;
  const double w = frequency_rad_s(kDamping_nms);
  ElasticRun shaft(elastic_train(kDamping_nms, 0.0), moving(3.0, 0.0, 0.01));
  const double momentum = momentum_nms(shaft.x());
  for (int k = 1; k <= 60; ++k) {
    shaft.run(0.01, 100, 0.0, 0.0);
    const double t = 0.01 * k;
    ASSERT_NEAR(shaft.x().twist_rad, 0.01 * std::exp(-d * t) * (std::cos(w * t) + d / w * std::sin(w * t)),
                2e-9);
    ASSERT_NEAR(momentum_nms(shaft.x()), momentum, 1e-15);
  }
  EXPECT_NEAR(fastest_time_constant_s(elastic_train(kDamping_nms, 0.0)),
              1.0 / std::sqrt(kStiffness_nm * kMobility), 1e-17);
}

// Catches: poles of an overdamped shaft taken for those of a soft one: d = 437.5, w0^2 = 43750, poles at 56
// and 819.
TEST(TwoMass, ALotOfDampingShortensTheFastestTimeConstant) {
  const double d = 437.5;
  EXPECT_NEAR(fastest_time_constant_s(elastic_train(1.0, 0.0)), 1.0 / (d + std::sqrt(d * d - 43750.0)),
              1e-17);
}

// Catches: a locked rotor that the shaft moves, or that holds the load as well.
TEST(TwoMass, BehindALockedRotorTheLoadSwingsAlone) {
  MechanicsParameters p = elastic_train(0.0, 0.0);
  p.motion = ShaftMotion::kLocked;
  ElasticRun shaft(p, {.speed_rad_s = 7.0, .angle_rad = 2.0, .twist_rad = 0.01});
  const double w = std::sqrt(kStiffness_nm / kLoad_kgm2);
  shaft.run(7.25 * 2.0 * std::numbers::pi / w, 7250, 0.5, 0.0);
  EXPECT_EQ(shaft.x().speed_rad_s, 0.0);
  EXPECT_EQ(shaft.x().angle_rad, 2.0);
  EXPECT_NEAR(shaft.x().twist_rad, 0.0, 1e-11);
  EXPECT_NEAR(shaft.x().load_speed_rad_s, 0.01 * w, 1e-9);
}

// Catches: torque or load that acts on the wrong mass. Without friction and once the vibration is gone the
// two masses turn as one.
TEST(TwoMass, AStiffShaftTurnsAsARigidOne) {
  MechanicsParameters p = elastic_train(1.0, 0.0);
  p.shaft_stiffness_nm = 2e4;
  ElasticRun elastic(p);
  p.shaft_stiffness_nm = p.shaft_damping_nms = 0.0;
  ShaftRun<ShaftState> rigid(p);
  elastic.run(0.1, 2000, 0.3, 0.5);
  rigid.run(0.1, 10, 0.3, 0.5);
  EXPECT_NEAR(elastic.x().speed_rad_s, rigid.x().speed_rad_s, 1e-9);
  EXPECT_NEAR(elastic.x().load_speed_rad_s, rigid.x().speed_rad_s / kRatio, 1e-9);
}

// Across the play at 1 rad/s: 10 ms of free flight, half a period of contact, and back at -1 rad/s. Catches:
// a shaft that bears within its play, teeth that meet at the whole play, teeth that stick, contact that gives
// or takes energy or momentum, a border seen at the end of a step only.
TEST(TwoMass, AcrossTheBacklashItFliesFreelyAndBouncesElasticallyWithoutDamping) {
  for (const double sign : {1.0, -1.0}) {
    ElasticRun shaft(elastic_train(0.0, kPlay_rad), moving(2.0, sign, 0.0));
    const TwoMassState start = shaft.x();
    const double start_j = energy_j(shaft.constants(), start);
    shaft.run(0.0099, 33, 0.0, 0.0);
    EXPECT_EQ(shaft.x().speed_rad_s, start.speed_rad_s);
    EXPECT_EQ(shaft.x().load_speed_rad_s, start.load_speed_rad_s);
    EXPECT_NEAR(shaft.x().twist_rad, sign * 0.0099, 1e-15);
    const double contact_s = std::numbers::pi / frequency_rad_s(0.0);
    shaft.run(0.0001 + 0.5 * contact_s, 100, 0.0, 0.0);
    EXPECT_NEAR(sign * shaft.x().twist_rad, 0.5 * kPlay_rad + 1.0 / frequency_rad_s(0.0), 1e-10);
    shaft.run(0.5 * contact_s + 0.005, 170, 0.0, 0.0);
    EXPECT_NEAR(twist_speed_rad_s(shaft.x()), -sign, 1e-8);
    EXPECT_NEAR(shaft.x().twist_rad, sign * (0.5 * kPlay_rad - 0.005), 1e-9);
    EXPECT_NEAR(momentum_nms(shaft.x()), momentum_nms(start), 1e-15);
    EXPECT_NEAR(energy_j(shaft.constants(), shaft.x()), start_j, 1e-10);
    EXPECT_EQ(shaft.events(), 2);
  }
}

// The teeth part where spring and damper cancel, before the shaft has sprung back: x' = v exp(-d t) (cos w t
// - d/w sin w t) at tan w t = -D w/(K - D d). Catches: damping that pulls the teeth together, teeth that part
// at the border only, an impact that loses nothing.
TEST(TwoMass, DampedTeethPartWhereTheyWouldPullAndLoseTheEnergyThatTheClosedFormSays) {
  constexpr double kDamping_nms = 0.1;
  const double d = 0.5 * kDamping_nms * kMobility;
  const double w = frequency_rad_s(kDamping_nms);
  const double angle_rad =
      std::numbers::pi - std::atan(kDamping_nms * w / (kStiffness_nm - kDamping_nms * d));
  const double left = std::exp(-d * angle_rad / w) * (std::cos(angle_rad) - d / w * std::sin(angle_rad));
  ElasticRun shaft(elastic_train(kDamping_nms, kPlay_rad), moving(0.0, 1.0, 0.0));
  const double start_j = energy_j(shaft.constants(), shaft.x());
  shaft.run(0.01 + angle_rad / w + 1e-4, 300, 0.0, 0.0);
  EXPECT_GT(shaft.x().twist_rad, 0.5 * kPlay_rad);  // not yet sprung back
  EXPECT_EQ(shaft.branch().contact, 0.0);
  EXPECT_NEAR(twist_speed_rad_s(shaft.x()), left, 1e-9);
  shaft.run(0.01, 100, 0.0, 0.0);
  EXPECT_LT(shaft.x().twist_rad, 0.5 * kPlay_rad);
  EXPECT_NEAR(twist_speed_rad_s(shaft.x()), left, 1e-9);
  const double lost_j = start_j - energy_j(shaft.constants(), shaft.x());
  EXPECT_NEAR(lost_j, 0.5 / kMobility * (1.0 - left * left), 1e-12);
  EXPECT_NEAR(shaft.lost_j(), lost_j, 1e-12);
}

// Catches: teeth that wait for the border when they are pressed together again before the shaft has sprung
// back, and an event that repeats itself at once.
TEST(TwoMass, TeethThatAreApartMeetWhereTheShaftIsWhenTheyArePressedAgain) {
  constexpr double kDamping_nms = 2.0;
  const double beyond_rad = 0.01;
  const double yielding_rad_s = kStiffness_nm * beyond_rad / kDamping_nms;
  ElasticRun shaft(elastic_train(kDamping_nms, kPlay_rad),
                   moving(0.0, -1.1 * yielding_rad_s, 0.5 * kPlay_rad + beyond_rad));
  shaft.step(1e-6, 1.0, 0.0);
  EXPECT_EQ(shaft.branch().contact, 0.0);
  EXPECT_EQ(shaft.branch().contact_rad, 0.5 * kPlay_rad);
  shaft.run(5e-4, 50, 1.0, 0.0);
  EXPECT_EQ(shaft.branch().contact, 1.0);
  EXPECT_GT(shaft.x().twist_rad, 0.5 * kPlay_rad + 0.9 * beyond_rad);
  EXPECT_EQ(shaft.events(), 1);
}

// Catches: sides of the play exchanged in settled(), a quantity that is not set exactly, a settled state that
// the next branch takes for the old one.
TEST(TwoMass, ASettledEventBelongsToTheNextBranch) {
  const ShaftConstants c = constants_of(elastic_train(0.1, kPlay_rad));
  const double half_rad = 0.5 * kPlay_rad;
  const auto branch = [&](const TwoMassState& x) { return branch_of(c, x, 0.0, 0.0, false); };
  EXPECT_EQ(settled(c, moving(1.0, 2.0, 0.0101), 2).twist_rad, half_rad);
  EXPECT_EQ(settled(c, moving(1.0, -2.0, -0.0099), 3).twist_rad, -half_rad);
  EXPECT_EQ(settled(c, moving(1.0, -2.0, 0.0101), 3).twist_rad, half_rad);
  EXPECT_EQ(branch(settled(c, moving(1.0, 2.0, 0.0101), 2)).contact, 1.0);
  EXPECT_EQ(branch(settled(c, moving(1.0, -2.0, -0.0101), 3)).contact_rad, -half_rad);
  const ShaftBranch within = branch(settled(c, moving(1.0, -2.0, 0.0101), 3));
  EXPECT_EQ(within.contact, 0.0);
  EXPECT_EQ(within.contact_rad, 0.0);
  const TwoMassState parting = settled(c, moving(1.0, -2.0, 0.0141), 2);
  EXPECT_NEAR(parting.twist_rad, half_rad + 0.1 * 2.0 / kStiffness_nm, 1e-17);
  EXPECT_EQ(branch(parting).contact, 0.0);
  EXPECT_EQ(branch(parting).contact_rad, half_rad);
  std::array<double, 4> values{};
  EXPECT_EQ(event_values(c, parting, branch(parting), 0.0, 0.0, values), 4);
  EXPECT_EQ(values[2], 0.0);
  EXPECT_EQ(settled(c, moving(1.0, 2.0, 0.0), 0).speed_rad_s, 0.0);
  EXPECT_EQ(settled(c, moving(1.0, 2.0, 0.0), 1).load_speed_rad_s, 0.0);
}

// Catches: a passive load that the shaft creeps past, or that does not act on the load but on the rotor.
TEST(TwoMass, APassiveLoadHoldsTheOutputWhileTheShaftIsWoundUp) {
  MechanicsParameters p = elastic_train(0.2, 0.0);
  p.passive_load_nm = 1.0;
  ElasticRun shaft(p);
  shaft.run(0.5, 5000, 0.15, 0.0);  // overshoots to 0.86 N·m at the output
  EXPECT_EQ(shaft.x().load_speed_rad_s, 0.0);
  EXPECT_NEAR(shaft.x().twist_rad, kRatio * 0.15 / kStiffness_nm, 1e-9);
  EXPECT_NEAR(load_side(shaft.constants(), shaft.x(), 0.0).angle_rad, 0.0, 1e-13);
  shaft.run(0.5, 5000, 0.3, 0.0);                         // 1.2 N·m
  EXPECT_NEAR(momentum_nms(shaft.x()), 0.2 * 0.5, 0.02);  // less the time until it breaks away
  EXPECT_NEAR(shaft.x().load_speed_rad_s, shaft.x().speed_rad_s / kRatio, 1e-6);
}

// RK4 in steps of 0.02 of the shaft's radian errs by 1e-7. Catches: a load that yields to the shaft, or a
// rotor to its spring, only at the end of a step.
TEST(TwoMass, TheBreakawayOfEitherMassIsLocatedWithinTheStep) {
  MechanicsParameters passive = elastic_train(0.01, 0.0);
  passive.passive_load_nm = 1.0;
  MechanicsParameters sticking = elastic_train(0.01, 0.0);
  sticking.static_friction_nm = sticking.coulomb_friction_nm = 0.2;
  const auto after = [](const MechanicsParameters& p, int steps, double torque_nm, double load_nm) {
    ElasticRun shaft(p);
    shaft.run(0.03, steps, torque_nm, load_nm);
    return shaft.x();
  };
  for (const double torque_nm : {0.3, 0.41, 0.57}) {
    const TwoMassState load_freed = after(passive, 300, torque_nm, 0.0);
    EXPECT_NEAR(load_freed.load_speed_rad_s, after(passive, 30'000, torque_nm, 0.0).load_speed_rad_s, 1e-5);
    EXPECT_GT(load_freed.load_speed_rad_s, 0.1);
    const TwoMassState rotor_freed = after(sticking, 300, 0.0, -4.0 * torque_nm);
    EXPECT_NEAR(rotor_freed.speed_rad_s, after(sticking, 30'000, 0.0, -4.0 * torque_nm).speed_rad_s, 1e-5);
    EXPECT_GT(rotor_freed.speed_rad_s, 0.1);
  }
}

// Catches: a load that stands against the torque of the shaft alone, or turns the wrong way when it yields.
TEST(TwoMass, AnActiveLoadBeyondThePassiveOneTurnsAStandingOutputBackwards) {
  MechanicsParameters p = elastic_train(0.0, 0.0);
  p.passive_load_nm = 1.0;
  const TwoMassState wound{.twist_rad = 0.01};  // 0.5 N·m
  for (const double load_nm : {1.49, 1.51}) {
    const ShaftBranch branch = branch_of(constants_of(p), wound, 0.0, load_nm, false);
    EXPECT_EQ(branch.load_turns, load_nm > 1.5 ? 1.0 : 0.0);
    EXPECT_EQ(branch.load_direction, load_nm > 1.5 ? -1.0 : 0.0);
  }
}

// Catches: stiction of the rotor that compares the torque of the machine alone, without that of the shaft.
TEST(TwoMass, AWoundUpShaftPullsTheRotorOutOfItsStiction) {
  MechanicsParameters p = elastic_train(0.2, 0.0);
  p.coulomb_friction_nm = 0.01;
  p.static_friction_nm = 0.05;
  for (const double twist_rad : {0.0039, 0.0041}) {  // 0.05 N·m at the rotor are 0.004 rad
    const ShaftBranch branch =
        branch_of(constants_of(p), TwoMassState{.twist_rad = twist_rad}, 0.0, 0.0, false);
    EXPECT_EQ(branch.turns, twist_rad > 0.004 ? 1.0 : 0.0);
    EXPECT_EQ(branch.direction, twist_rad > 0.004 ? -1.0 : 0.0);
  }
}

// Catches: a prime mover that the shaft slows down, a load that does not follow, a twist without the ratio.
TEST(TwoMass, APrimeMoverCarriesTheLoadThroughTheShaft) {
  MechanicsParameters p = elastic_train(0.5, 0.0);
  p.motion = ShaftMotion::kImposed;
  p.imposed_speed_rad_s = 40.0;
  p.imposed_acceleration_rad_s2 = 400.0;
  p.load_viscous_friction_nms = 0.02;
  ElasticRun shaft(p);
  shaft.run(2.0, 4000, 0.0, 0.0);
  EXPECT_EQ(shaft.x().speed_rad_s, 40.0);
  EXPECT_NEAR(shaft.x().load_speed_rad_s, 10.0, 1e-9);
  EXPECT_NEAR(shaft.x().twist_rad, 0.02 * 10.0 / kStiffness_nm, 1e-12);
  EXPECT_NEAR(load_side(shaft.constants(), shaft.x(), 3.0).angle_rad,
              (3.0 + shaft.x().angle_rad) / kRatio - shaft.x().twist_rad, 1e-14);
}

// Catches: a bump that the load feels at once.
TEST(TwoMass, ABumpMovesTheRotorAlone) {
  const TwoMassState after = bumped(constants_of(elastic_train(0.0, 0.0)), moving(1.0, 0.0, 0.0), 1e-3);
  EXPECT_NEAR(after.speed_rad_s, 14.0, 1e-13);
  EXPECT_EQ(after.load_speed_rad_s, 1.0);
}

// Catches: any torque that no loss accounts for, a loss that the motion does not feel, teeth that pull, teeth
// that bear within the play, a mass that stands against more than its friction.
TEST(TwoMass, TheEnergyBalanceHoldsAndTheTeethOnlyPushInARandomRunWithAllOfIt) {
  MechanicsParameters p = elastic_train(0.05, kPlay_rad);
  p.viscous_friction_nms = 1e-3;
  p.coulomb_friction_nm = 0.01;
  p.static_friction_nm = 0.02;
  p.load_viscous_friction_nms = 0.01;
  p.passive_load_nm = 0.1;
  p.fan_torque_nms2 = 1e-3;
  ElasticRun shaft(p);
  const ShaftConstants& c = shaft.constants();
  std::mt19937_64 engine(7);
  std::uniform_real_distribution<double> draw(-0.3, 0.3);
  int pieces_at_rest = 0;
  int pieces_apart = 0;
  for (int k = 0; k < 400; ++k) {
    const double torque_nm = k % 4 == 3 ? 0.0 : draw(engine);
    const double load_nm = draw(engine);
    for (int n = 0; n < 200; ++n) {
      shaft.step(5e-5, torque_nm, load_nm);
      const TwoMassState& x = shaft.x();
      const double shaft_nm = shaft_torque_nm(c, x, shaft.branch());
      ASSERT_GE(shaft_nm * x.twist_rad, -1e-12);
      ASSERT_TRUE(shaft_nm == 0.0 || std::abs(x.twist_rad) >= 0.5 * kPlay_rad - 1e-12);
      // Runge-Kutta at w h = 0.01, and rounding, on sums of several joules.
      ASSERT_NEAR(shaft.supplied_j(), shaft.lost_j() + energy_j(c, x), 1e-8) << k << " " << n;
      pieces_at_rest += shaft.branch().turns == 0.0 || shaft.branch().load_turns == 0.0 ? 1 : 0;
      pieces_apart += shaft.branch().contact == 0.0 ? 1 : 0;
    }
  }
  EXPECT_GT(shaft.lost_j(), 1.0);
  EXPECT_GT(shaft.events(), 200);
  EXPECT_GT(pieces_at_rest, 100);
  EXPECT_GT(pieces_apart, 100);
}

// Pressed against one side by a constant torque the bounces die out. Catches: teeth that chatter for ever.
TEST(TwoMass, PressedTogetherTheTeethComeToRestAgainstEachOther) {
  MechanicsParameters p = elastic_train(0.05, kPlay_rad);
  p.load_viscous_friction_nms = 0.1;
  ElasticRun shaft(p);
  shaft.run(3.0, 30'000, 0.05, 0.0);
  const int events = shaft.events();
  EXPECT_GT(events, 2);
  shaft.run(1.0, 10'000, 0.05, 0.0);
  EXPECT_EQ(shaft.events(), events);
  EXPECT_NEAR(shaft.x().twist_rad, 0.5 * kPlay_rad + kRatio * 0.05 / kStiffness_nm, 1e-7);
}

}  // namespace
}  // namespace drivebench::two_mass_test
