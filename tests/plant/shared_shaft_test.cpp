#include <gtest/gtest.h>

#include <cmath>

#include "plant/axis.hpp"
#include "plant/math/rk4.hpp"

namespace drivebench::shared_shaft_test {
namespace {

constexpr AxisTiming kTiming{.period_s = 1e-4, .substeps = 4};

constexpr PhaseCommand volts(double a) {
  return {.gates = Gates::kVoltage, .setpoint = {.a = a}};
}

/// The DC motor DC-A of the book, its inertia and friction doubled for two of them on one shaft.
AxisParameters dc_axis() {
  AxisParameters p;
  p.machine = PmDcMachineParameters{
      .armature_resistance_ohm = 2.0, .armature_inductance_h = 2e-3, .torque_constant_nm_per_a = 0.07};
  p.mechanics = {.inertia_kgm2 = 1.2e-4, .viscous_friction_nms = 8e-4};
  p.drive.amplifier = {.voltage_limit_v = 100.0, .over_current_a = 100.0};
  return p;
}

/// Motor and generator written out in one system: i1, i2, w, angle.
struct PairState {
  double i1;
  double i2;
  double w;
  double angle;
};

PairState pair_step(const PairState& x, double u1, double u2, double ratio, double h) {
  return rk4_step(x, h, [=](const PairState& s) -> PairState {
    const double torque = 0.07 * s.i1 + 0.07 * s.i2 / ratio;
    return {(u1 - 2.0 * s.i1 - 0.07 * s.w) / 2e-3, (u2 - 2.0 * s.i2 - 0.07 * s.w / ratio) / 2e-3,
            (torque - 8e-4 * s.w) / 1.2e-4, s.w};
  });
}

// Both are the same Runge-Kutta method on the same equations: what remains is rounding. Catches: a machine
// that does not see the other's torque or speed, stages that are out of step, a torque counted twice, the
// gear the wrong way round.
TEST(SharedShaft, TwoMachinesAreOneSystem) {
  for (const double ratio : {1.0, 2.5}) {
    AxisParameters p = dc_axis();
    p.mechanics.gear_ratio = ratio;
    Axis first(p, kTiming, 1, 0);
    Axis second(dc_axis(), kTiming, 1, 1);
    PairState x{};
    for (Tick tick = 0; tick < 3000; ++tick) {
      const double u2 = tick < 1500 ? 0.0 : -15.0;
      Axis::advance_pair(first, second, volts(20.0), volts(u2), tick);
      for (int n = 0; n < kTiming.substeps; ++n)
        x = pair_step(x, 20.0, u2, ratio, kTiming.period_s / kTiming.substeps);
    }
    const Sample a = first.sample(3000);
    const Sample b = second.sample(3000);
    EXPECT_NEAR(a.true_i_a_a, x.i1, 1e-9);
    EXPECT_NEAR(b.true_i_a_a, x.i2, 1e-9);
    EXPECT_NEAR(a.speed_rad_s, x.w, 1e-9);
    EXPECT_NEAR(b.speed_rad_s, x.w / ratio, 1e-9);
    EXPECT_NEAR(a.angle_rad, x.angle, 1e-8);
    EXPECT_NEAR(b.angle_rad, x.angle / ratio, 1e-8);
    EXPECT_EQ(b.encoder_count, static_cast<std::int64_t>(std::floor(b.angle_rad * 2000 / (2 * M_PI))));
  }
}

/// Energies of a run of motor and load machine behind an elastic coupling with play.
struct Audit {
  double supplied_j = 0.0;
  double lost_j = 0.0;
  double stored_j = 0.0;
};

// The energy that both drives supply is lost in the windings and in friction or stored. The sums are
// trapezoids over 5 us: 1e-4 of the supplied energy. Catches: a coupling that creates or destroys energy.
TEST(SharedShaft, MotorAndLoadMachineConserveEnergy) {
  AxisParameters p = dc_axis();
  p.mechanics = {.inertia_kgm2 = 6e-5,
                 .viscous_friction_nms = 4e-4,
                 .load_inertia_kgm2 = 6e-5,
                 .load_viscous_friction_nms = 4e-4,
                 .shaft_stiffness_nm = 20.0,
                 .shaft_damping_nms = 1e-3};
  constexpr AxisTiming kFine{.period_s = 5e-6, .substeps = 1};
  Axis first(p, kFine, 1, 0);
  Axis second(dc_axis(), kFine, 1, 1);
  const ShaftConstants shaft = constants_of(p.mechanics);
  Audit audit;
  Sample a = first.sample(0);
  Sample b = second.sample(0);
  TwoMassState x = first.state().shaft;
  ShaftBranch touching{.contact = 1.0};
  for (Tick tick = 0; tick < 40'000; ++tick) {
    const double u1 = tick < 20'000 ? 20.0 : -10.0;
    const double u2 = tick < 10'000 ? 0.0 : 5.0;
    Axis::advance_pair(first, second, volts(u1), volts(u2), tick);
    const Sample a1 = first.sample(tick + 1);
    const Sample b1 = second.sample(tick + 1);
    const TwoMassState x1 = first.state().shaft;
    const auto mean = [](double from, double to) { return 0.5 * (from + to) * kFine.period_s; };
    audit.supplied_j += u1 * mean(a.true_i_a_a, a1.true_i_a_a);
    audit.supplied_j += u2 * mean(b.true_i_a_a, b1.true_i_a_a);
    audit.lost_j += 2.0 * mean(std::pow(a.true_i_a_a, 2), std::pow(a1.true_i_a_a, 2));
    audit.lost_j += 2.0 * mean(std::pow(b.true_i_a_a, 2), std::pow(b1.true_i_a_a, 2));
    audit.lost_j += mean(losses_w(shaft, x, touching), losses_w(shaft, x1, touching));
    a = a1;
    b = b1;
    x = x1;
  }
  audit.stored_j = energy_j(shaft, x) + 1e-3 * (std::pow(a.true_i_a_a, 2) + std::pow(b.true_i_a_a, 2));
  EXPECT_GT(audit.supplied_j, 1.0);
  EXPECT_NEAR(audit.supplied_j, audit.lost_j + audit.stored_j, 1e-4 * audit.supplied_j);
}

/// A brushless motor whose run has every kind of event: its emf has corners, its currents die in the diodes
/// of a low link, and dry friction stops it.
AxisParameters eventful_axis() {
  AxisParameters p;
  p.machine = BldcMachineParameters{.pole_pairs = 2,
                                    .stator_resistance_ohm = 0.7,
                                    .self_inductance_h = 2.72e-3,
                                    .mutual_inductance_h = 0.15e-3,
                                    .torque_constant_nm_per_a = 0.5128,
                                    .star = true};
  p.mechanics = {.inertia_kgm2 = 2e-4,
                 .viscous_friction_nms = 0.002,
                 .coulomb_friction_nm = 0.1,
                 .static_friction_nm = 0.2};
  p.drive.amplifier = {.voltage_limit_v = 60.0, .over_current_a = 1000.0};
  return p;
}

PhaseCommand eventful_command(Tick tick) {
  if (tick % 500 < 60) return {.gates = Gates::kVoltage, .setpoint = {.a = -40.0, .b = 10.0, .c = 30.0}};
  return {.gates = Gates::kOff};
}

// The torques of both machines free the shaft, of which the second one's acts through its rising current.
// Catches: a breakaway that is looked for in the torque of the first machine alone, or at the ends of
// substeps.
TEST(SharedShaft, TheBreakawayIsLocatedWithinTheSubstep) {
  AxisParameters p = dc_axis();
  p.mechanics.static_friction_nm = p.mechanics.coulomb_friction_nm = 0.1;
  const auto speed_rad_s = [&p](int substeps, double first_v, double second_v) {
    const AxisTiming timing{.period_s = 1e-3, .substeps = substeps};
    Axis first(p, timing, 1, 0);
    Axis second(dc_axis(), timing, 1, 1);
    for (Tick tick = 0; tick < 3; ++tick)
      Axis::advance_pair(first, second, volts(first_v), volts(second_v), tick);
    return first.sample(3).speed_rad_s;
  };
  for (const double second_v : {2.9, 3.3, 4.1}) {
    const double exact_rad_s = speed_rad_s(64, 1.0, second_v);
    EXPECT_GT(exact_rad_s, 0.01);
    EXPECT_NEAR(speed_rad_s(16, 1.0, second_v), exact_rad_s, 1e-6 * exact_rad_s) << second_v;
  }
}

/// A machine that neither drives nor brakes what it hangs on.
AxisParameters idle_axis() {
  AxisParameters p = dc_axis();
  std::get<PmDcMachineParameters>(p.machine).torque_constant_nm_per_a = 1e-12;
  return p;
}

// A machine alone on its shaft and one with an idle partner take the same steps and search for the same
// events: what remains is rounding, which the corners pass on. Catches: an event that is cut where a straight
// line has it, one of the second machine that is settled in the first, a shaft whose dry friction is looked
// at before the events of the machines.
TEST(SharedShaft, AnIdlePartnerChangesNothing) {
  Axis alone(eventful_axis(), kTiming, 1, 0);
  Axis first(eventful_axis(), kTiming, 1, 0);
  Axis idle_second(idle_axis(), kTiming, 1, 1);
  AxisParameters shaft = idle_axis();
  shaft.mechanics = eventful_axis().mechanics;
  Axis idle_first(shaft, kTiming, 1, 0);
  Axis second(eventful_axis(), kTiming, 1, 1);
  int stood = 0;
  int freewheeled = 0;
  for (Tick tick = 0; tick < 1500; ++tick) {
    const PhaseCommand command = eventful_command(tick);
    alone.advance(command, tick);
    Axis::advance_pair(first, idle_second, command, volts(0.0), tick);
    Axis::advance_pair(idle_first, second, volts(0.0), command, tick);
    const Sample expected = alone.sample(tick + 1);
    for (const Sample& s : {first.sample(tick + 1), second.sample(tick + 1)}) {
      ASSERT_NEAR(s.true_i_a_a, expected.true_i_a_a, 1e-9) << tick;
      ASSERT_NEAR(s.true_i_b_a, expected.true_i_b_a, 1e-9) << tick;
      ASSERT_NEAR(s.speed_rad_s, expected.speed_rad_s, 1e-9) << tick;
      ASSERT_NEAR(s.angle_rad, expected.angle_rad, 1e-9) << tick;
    }
    if (expected.speed_rad_s == 0.0) ++stood;
    if (command.gates == Gates::kOff && expected.true_i_a_a != 0.0) ++freewheeled;
  }
  EXPECT_GT(stood, 10);
  EXPECT_GT(freewheeled, 10);
}

std::size_t row_of_fault(const char* name) {
  return find_injectable_fault(name);
}

/// Motor and load machine, ratio 2, on an elastic shaft or a rigid one.
AxisParameters geared_axis(bool elastic) {
  AxisParameters p = dc_axis();
  p.mechanics.gear_ratio = 2.0;
  p.mechanics.load_inertia_kgm2 = 3e-4;
  if (!elastic) return p;
  p.mechanics.shaft_stiffness_nm = 20.0;
  p.mechanics.shaft_damping_nms = 0.05;
  return p;
}

// The rotor that is blocked stands; the other one stands with it on a rigid shaft, and on an elastic one
// winds it up by n tau/K, with the stall torque of 10 A. Catches: a fault of the second axis that is not
// looked at, one that stops the rotor of the first, one that outlives its fault.
TEST(SharedShaft, EitherRotorCanBeBlocked) {
  for (const bool elastic : {false, true}) {
    Axis first(geared_axis(elastic), kTiming, 1, 0);
    Axis second(dc_axis(), kTiming, 1, 1);
    Tick tick = 0;
    const auto run = [&](int ticks) {
      for (const Tick end = tick + ticks; tick < end; ++tick)
        Axis::advance_pair(first, second, volts(20.0), volts(0.0), tick);
    };
    run(500);
    EXPECT_GT(second.sample(tick).speed_rad_s, 20.0);
    second.inject(row_of_fault("blocked_rotor"), 1.0);
    run(1);
    const double held_rad = second.sample(tick).angle_rad;
    const double rotor_rad = first.sample(tick).angle_rad;
    run(5000);
    EXPECT_EQ(second.sample(tick).speed_rad_s, 0.0);
    EXPECT_NEAR(second.sample(tick).angle_rad, held_rad, 1e-12);
    EXPECT_NEAR(first.sample(tick).speed_rad_s, 0.0, 1e-9);
    EXPECT_NEAR(first.sample(tick).true_i_a_a, 10.0, 1e-9);
    if (elastic) {
      EXPECT_NEAR(first.state().shaft.twist_rad, 2.0 * 0.7 / 20.0, 1e-9);
    } else {
      EXPECT_NEAR(first.sample(tick).angle_rad, rotor_rad, 1e-12);
    }
    second.inject(row_of_fault("blocked_rotor"), 0.0);
    run(500);
    EXPECT_GT(second.sample(tick).speed_rad_s, 20.0);
  }
}

// An impulse on the second rotor: on a rigid shaft it is one of 1/n on the first, of J1 + J2/n^2; on an
// elastic one the load alone takes it. Catches: a bump that lands on the rotor of the first, one without the
// ratio.
TEST(SharedShaft, ABumpOnTheOutputActsOnTheOutput) {
  Axis rigid(geared_axis(false), kTiming, 1, 0);
  rigid.bump_output(0.003);
  EXPECT_NEAR(rigid.sample(0).speed_rad_s, 0.5 * 0.003 / (1.2e-4 + 3e-4 / 4.0), 1e-12);
  Axis elastic(geared_axis(true), kTiming, 1, 0);
  elastic.bump_output(0.003);
  EXPECT_EQ(elastic.sample(0).speed_rad_s, 0.0);
  EXPECT_NEAR(elastic.sample(0).load_speed_rad_s, 0.003 / 3e-4, 1e-12);
}

// Catches: a pair of which one goes on after the other has diverged.
TEST(SharedShaft, IfOneAxisDivergesBothAreHeld) {
  AxisParameters bad = dc_axis();
  std::get<PmDcMachineParameters>(bad.machine).armature_inductance_h = 1e-7;  // far too fast for the step
  Axis first(dc_axis(), kTiming, 1, 0);
  Axis second(bad, kTiming, 1, 1);
  for (Tick tick = 0; tick < 20; ++tick)
    Axis::advance_pair(first, second, volts(20.0), volts(10.0), tick);
  EXPECT_NE(first.sample(20).faults & kDiverged, 0u);
  EXPECT_NE(second.sample(20).faults & kDiverged, 0u);
  EXPECT_TRUE(std::isfinite(first.sample(20).speed_rad_s));
}

}  // namespace
}  // namespace drivebench::shared_shaft_test
