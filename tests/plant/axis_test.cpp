#include "plant/axis.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "tests/plant/servo_axis.hpp"

namespace drivebench::axis_test {
namespace {

constexpr double kTurn_rad = 2.0 * std::numbers::pi;

constexpr PhaseCommand volts(double a, double b) {
  return {.gates = Gates::kVoltage, .setpoint = {a, b}};
}

/// Follows the A/B lines of an axis by their edges alone.
struct LineDecoder {
  std::int64_t count = 0;
  Edge newest{};

  void follow(const Axis& axis) {
    double last_s = 0.0;
    axis.encoder().for_each_edge(axis.last_tick(), axis.last_tick_turn(), axis.last_tick_encoder(),
                                 axis.injected(), [&](const Edge& edge) {
                                   ASSERT_EQ(edge.count, count + edge.direction);
                                   ASSERT_GE(edge.time_s, last_s - 1e-12);
                                   ASSERT_LE(edge.time_s, kServoTick_s + 1e-12);
                                   count = edge.count;
                                   newest = edge;
                                   last_s = edge.time_s;
                                 });
  }
};

// Catches: edges lost where ticks, turns, substeps or friction events meet; an encoder state that does not
// agree with the list of edges.
TEST(Axis, TheEdgesOfARandomRunAlwaysAddUpToTheCount) {
  AxisParameters p = servo_axis();
  p.mechanics.coulomb_friction_nm = 0.02;
  p.mechanics.static_friction_nm = 0.04;
  p.mechanics.inertia_kgm2 = 2e-6;  // reverses often
  p.encoder.counts_per_revolution = 20'000;
  Axis axis(p, kServoTiming, 1, 0);
  LineDecoder decoder;
  std::mt19937_64 engine(31);
  std::uniform_real_distribution<double> draw(-60.0, 60.0);
  PhaseCommand command;
  std::int64_t reversals = 0;
  for (Tick tick = 0; tick < 20'000; ++tick) {
    if (tick % 7 == 0) command = volts(draw(engine), draw(engine));
    if (tick % 50 == 49) command.gates = Gates::kOff;
    axis.set_load(draw(engine) * 2e-3, tick, 0);
    axis.advance(command, tick);
    decoder.follow(axis);
    const EncoderState& s = axis.state().encoder;
    ASSERT_EQ(decoder.count, s.count) << "tick " << tick;
    if (s.last_edge_tick == tick && s.edges_seen > 0) {
      ASSERT_EQ(decoder.newest.time_s, s.last_edge_s);
      ASSERT_EQ(decoder.newest.direction, s.direction);
      reversals += s.direction_changed;
    }
    ASSERT_EQ(axis.sample(tick + 1).encoder_count, s.count);
  }
  EXPECT_GT(reversals, 200);
}

// A magnetised rotor trembles by 1e-17 rad around a boundary of the encoder, which is also where the angle
// wraps. Catches: an angle of a full turn after -1e-17 rad, and counts that change without an edge.
TEST(Axis, TremblingAtTheWrapLosesNoEdge) {
  for (const double volts_a : {1.0, 1.01, 3.7, 12.0}) {
    Axis axis(servo_axis(), kServoTiming, 1, 0);
    LineDecoder decoder;
    for (Tick tick = 0; tick < 1000; ++tick) {
      axis.advance(volts(volts_a, 7.3), tick);
      decoder.follow(axis);
      ASSERT_EQ(decoder.count, axis.state().encoder.count) << "tick " << tick;
      const double angle_rad = axis.state().shaft.angle_rad;
      ASSERT_TRUE(angle_rad >= 0.0 && angle_rad < kTurn_rad);
    }
  }
}

// Catches: turns counted in the wrong direction, or one wrap per tick only.
TEST(Axis, TheAngleStaysWithinATurnAndTheTurnsAreCounted) {
  for (const double speed_rad_s : {900.0, -900.0, 4e5, -4e5}) {
    AxisParameters p = servo_axis();
    p.mechanics.viscous_friction_nms = 0.0;
    Axis axis(p, kServoTiming, 1, 0);
    spin(axis, speed_rad_s, 1.0);
    for (Tick tick = 0; tick < 1000; ++tick)
      axis.advance({}, tick);
    const double angle_rad = 1.0 + speed_rad_s * 1000 * kServoTick_s;
    const AxisState& s = axis.state();
    EXPECT_TRUE(s.shaft.angle_rad >= 0.0 && s.shaft.angle_rad < kTurn_rad);
    EXPECT_EQ(s.turns, static_cast<std::int64_t>(std::floor(angle_rad / kTurn_rad)));
    EXPECT_NEAR(axis.sample(1000).angle_rad, angle_rad, 1e-11 * std::abs(angle_rad));
    EXPECT_EQ(s.encoder.count, static_cast<std::int64_t>(std::floor(angle_rad * 2000 / kTurn_rad)));
  }
}

// Catches: NaN that reaches a sample, a divergence that is not latched, a state that goes on after it.
TEST(Axis, ADivergedStateIsHeldAndLatched) {
  AxisParameters p = servo_axis();
  induction(p).stator_inductance_h = 1e-5;
  induction(p).rotor_inductance_h = 1e-5;
  induction(p).mutual_inductance_h = 0.9e-5;  // far too fast for the step
  Axis axis(p, kServoTiming, 1, 0);
  Tick tick = 0;
  Sample before = axis.sample(0);
  while ((axis.state().faults & kDiverged) == 0 && tick < 100) {
    before = axis.sample(tick);
    axis.advance(volts(5.0, 3.0), tick++);
  }
  ASSERT_LT(tick, 100);
  for (int i = 0; i < 3; ++i) {
    const Sample s = axis.sample(tick);
    EXPECT_EQ(s.true_i_a_a, before.true_i_a_a);
    EXPECT_EQ(s.angle_rad, before.angle_rad);
    EXPECT_EQ(s.encoder_count, before.encoder_count);
    EXPECT_TRUE(std::isfinite(s.i_a_a));
    EXPECT_NE(s.faults & kDiverged, 0u);
    EXPECT_TRUE(axis.last_tick().empty());
    axis.advance(volts(5.0, 3.0), tick++);
  }
}

// Catches: a divergence that hides from the check because it is not a number.
TEST(Axis, AnInfiniteLoadDiverges) {
  Axis axis(servo_axis(), kServoTiming, 1, 0);
  axis.set_load(std::numeric_limits<double>::infinity(), 0, 0);
  axis.advance({}, 0);
  EXPECT_EQ(axis.sample(1).faults, kDiverged);
  EXPECT_EQ(axis.sample(1).speed_rad_s, 0.0);
}

// Catches: constants that are derived once and for all, parameters that act a tick late.
TEST(Axis, ANewParameterHoldsFromTheNextAdvanceOn) {
  AxisParameters hot = servo_axis();
  induction(hot).rotor_resistance_ohm *= 1.5;
  Axis changed(servo_axis(), kServoTiming, 1, 0);
  Axis same(servo_axis(), kServoTiming, 1, 0);
  for (Axis* axis : {&changed, &same}) {
    for (Tick tick = 0; tick < 10; ++tick)
      axis->advance(volts(20.0, 0.0), tick);
  }
  Axis from_state(hot, kServoTiming, 1, 0);
  from_state.restore(changed.state());
  changed.set_parameters(hot);
  EXPECT_EQ(changed.sample(10).psi_a_wb, same.sample(10).psi_a_wb);
  for (Axis* axis : {&changed, &same, &from_state})
    axis->advance(volts(20.0, 0.0), 10);
  EXPECT_NE(changed.sample(11).psi_a_wb, same.sample(11).psi_a_wb);
  EXPECT_EQ(changed.sample(11).psi_a_wb, from_state.sample(11).psi_a_wb);

  AxisParameters dry = servo_axis();
  dry.mechanics.static_friction_nm = 1.0;
  changed.set_parameters(dry);
  spin(changed, 0.0);
  changed.advance({}, 11);
  EXPECT_EQ(changed.sample(12).faults, kShaftHeld);
}

// Catches: a sample that changes the axis, edges of another run after a restore.
TEST(Axis, SamplingChangesNothingAndARestoreForgetsTheSegments) {
  Axis axis(servo_axis(), kServoTiming, 1, 0);
  axis.advance(volts(20.0, 10.0), 0);
  const Sample first = axis.sample(1);
  const Sample second = axis.sample(1);
  EXPECT_EQ(first.true_i_a_a, second.true_i_a_a);
  EXPECT_EQ(first.torque_nm, second.torque_nm);
  EXPECT_EQ(axis.last_tick().size(), 5u);
  axis.restore(axis.state());
  EXPECT_TRUE(axis.last_tick().empty());
}

// Catches: a substep that is counted twice or left out. Five steps of 25 us against one tick of 25 us five
// times.
TEST(Axis, SubstepsOfATickAreTheSameAsShortTicks) {
  Axis one(servo_axis(), kServoTiming, 1, 0);
  Axis five(servo_axis(), {.period_s = kServoTick_s / 5, .substeps = 1}, 1, 0);
  for (Tick tick = 0; tick < 100; ++tick) {
    one.advance(volts(30.0, 10.0), tick);
    for (Tick n = 0; n < 5; ++n)
      five.advance(volts(30.0, 10.0), 5 * tick + n);
  }
  EXPECT_EQ(one.sample(100).true_i_a_a, five.sample(500).true_i_a_a);
  EXPECT_NEAR(one.sample(100).angle_rad, five.sample(500).angle_rad, 1e-14);
}

}  // namespace
}  // namespace drivebench::axis_test
