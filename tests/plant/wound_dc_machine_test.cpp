#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "plant/machines/separate_dc/separate_dc_machine.hpp"
#include "plant/machines/shunt_dc/shunt_dc_machine.hpp"
#include "tests/plant/dc_rig.hpp"

/// Separately excited and shunt machine. The book gives no numbers: 240 V, 160 rad/s, 10 kW.
namespace drivebench::wound_dc_machine_test {
namespace {

const SeparateDcMachineParameters kSeparate{.armature_resistance_ohm = 0.5,
                                            .armature_inductance_h = 5e-3,
                                            .motor_constant = 0.03,
                                            .field_resistance_ohm = 100.0,
                                            .field_inductance_h = 20.0};
const ShuntDcMachineParameters kShunt{.armature_resistance_ohm = 0.5,
                                      .armature_inductance_h = 5e-3,
                                      .motor_constant = 0.03,
                                      .field_resistance_ohm = 80.0,
                                      .adjusting_resistance_ohm = 20.0,
                                      .field_inductance_h = 20.0};
constexpr ShaftLoad kShaft{.inertia_kgm2 = 0.2, .friction_nms = 0.01};

template <class Parameters>
Parameters saturated(Parameters p) {
  p.field_inductance_h = 0.0;
  p.saturation_curve = wound_saturation();
  return p;
}

class RandomStates {
 public:
  explicit RandomStates(unsigned seed) : engine_(seed) {}
  double draw(double size) { return std::uniform_real_distribution<double>(-size, size)(engine_); }
  RotorMotion motion() { return motion_of({.speed_rad_s = draw(300.0), .angle_rad = draw(6.0)}); }
  TerminalInput terminals() { return voltage(draw(400.0), draw(400.0)); }

 private:
  std::mt19937_64 engine_;
};

// Catches: any wrong sign or factor in either equation, an energy that is not the integral of i_f over
// lambda_f, a saturation curve that is not odd.
TEST(SeparateDcMachine, InputPowerIsStoredLostOrDeliveredInRandomStates) {
  for (const SeparateDcMachineConstants& c : {constants_of(kSeparate), constants_of(saturated(kSeparate))}) {
    RandomStates random(23);
    for (int n = 0; n < 10'000; ++n) {
      const SeparateDcMachineState x{.i_a_a = random.draw(80.0), .field_flux_wb = random.draw(60.0)};
      ASSERT_LT(unbalanced(c, x, random.motion(), random.terminals()), 1e-9) << n;
      const SeparateDcMachineState open{.i_a_a = 0.0, .field_flux_wb = x.field_flux_wb};
      ASSERT_LT(unbalanced(c, open, random.motion(), open_terminals(random.draw(400.0))), 1e-9) << n;
    }
  }
}

// The same for the shunt machine, whose terminals feed both windings and whose open terminals leave a loop.
TEST(ShuntDcMachine, InputPowerIsStoredLostOrDeliveredInRandomStates) {
  for (const ShuntDcMachineConstants& c : {constants_of(kShunt), constants_of(saturated(kShunt))}) {
    RandomStates random(24);
    for (int n = 0; n < 10'000; ++n) {
      const ShuntDcMachineState x{.armature_a = random.draw(80.0), .field_flux_wb = random.draw(60.0)};
      const RotorMotion motion = random.motion();
      ASSERT_LT(unbalanced(c, x, motion, voltage(random.draw(400.0))), 1e-9) << n;
      const ShuntDcMachineState open = restricted(c, x, motion, open_terminals());
      ASSERT_LT(unbalanced(c, open, motion, open_terminals()), 1e-9) << n;
    }
  }
}

// Conventions. Catches: a pair of wrong signs that leaves the balance intact.
TEST(SeparateDcMachine, CurrentAndFieldOfOneSignGivePositiveTorque) {
  const SeparateDcMachineConstants c = constants_of(kSeparate);
  const SeparateDcMachineState slope = derivative(c, {}, motion_of({}), voltage(10.0, 3.0));
  EXPECT_NEAR(slope.i_a_a, 10.0 / 5e-3, 1e-9);
  EXPECT_NEAR(slope.field_flux_wb, 3.0, 1e-12);
  EXPECT_NEAR(torque_nm(c, {.i_a_a = 2.0, .field_flux_wb = 40.0}, motion_of({})), 2.4, 1e-12);
  EXPECT_NEAR(torque_nm(c, {.i_a_a = -2.0, .field_flux_wb = -40.0}, motion_of({})), 2.4, 1e-12);
  EXPECT_NEAR(winding_currents(c, {.i_a_a = 2.0, .field_flux_wb = -40.0}, motion_of({})).field, -2.0, 1e-12);
  EXPECT_EQ(rotor_flux_wb(c, {.i_a_a = 2.0, .field_flux_wb = -40.0}, motion_of({})).a, -40.0);
}

// Catches: a curve that is read on its left side, where its line goes on through negative values.
TEST(FieldWinding, ASaturationCurveIsOdd) {
  const FieldWinding field = field_winding(0.0, wound_saturation(), 0.25);
  for (const double flux_wb : {8.0, 16.0, 30.0, 47.0, 60.0}) {
    EXPECT_EQ(field_current_a(field, -flux_wb), -field_current_a(field, flux_wb));
    EXPECT_EQ(loop_current_a(field, -flux_wb), -loop_current_a(field, flux_wb));
    const double current_a = field_current_a(field, flux_wb);
    EXPECT_EQ(field_energy_j(field, -current_a), field_energy_j(field, current_a));
    EXPECT_EQ(differential_per_loop_inductance(field, -current_a),
              differential_per_loop_inductance(field, current_a));
  }
  EXPECT_EQ(field_current_a(field, 28.0), 1.0);
  EXPECT_EQ(loop_current_a(field, 28.25), 1.0);
  EXPECT_EQ(field_energy_j(field, 1.0), 28.0 - (4.0 + 11.0));
  EXPECT_EQ(smallest_inductance_h(0.0, wound_saturation()), 6.0 / 1.6);
}

// Catches: a saturated branch that is another model than the linear one. Rounding alone, in 1 s of transient.
TEST(WoundDcMachine, AStraightSaturationCurveIsTheFieldInductance) {
  const Curve straight({{0.0, 0.0}, {0.5, 10.0}, {1.0, 20.0}});
  SeparateDcMachineParameters separate = kSeparate;
  separate.field_inductance_h = 0.0;
  separate.saturation_curve = straight;
  ShuntDcMachineParameters shunt = kShunt;
  shunt.field_inductance_h = 0.0;
  shunt.saturation_curve = straight;
  Rig<SeparateDcMachineState> a;
  Rig<SeparateDcMachineState> b;
  run(a, 1.0, 1e-4, constants_of(kSeparate), voltage(240.0, 200.0), kShaft);
  run(b, 1.0, 1e-4, constants_of(separate), voltage(240.0, 200.0), kShaft);
  EXPECT_NEAR(a.machine.i_a_a, b.machine.i_a_a, 1e-9);
  EXPECT_NEAR(a.shaft.speed_rad_s, b.shaft.speed_rad_s, 1e-9);
  Rig<ShuntDcMachineState> d;
  Rig<ShuntDcMachineState> e;
  run(d, 1.0, 1e-4, constants_of(kShunt), voltage(240.0), kShaft);
  run(e, 1.0, 1e-4, constants_of(shunt), voltage(240.0), kShaft);
  run(d, 1.0, 1e-4, constants_of(kShunt), open_terminals(), kShaft);
  run(e, 1.0, 1e-4, constants_of(shunt), open_terminals(), kShaft);
  EXPECT_NEAR(d.machine.armature_a, e.machine.armature_a, 1e-9);
  EXPECT_NEAR(d.machine.field_flux_wb, e.machine.field_flux_wb, 1e-9);
  EXPECT_NEAR(d.shaft.speed_rad_s, e.shaft.speed_rad_s, 1e-9);
}

// DC-06: V_S/(K_m lambda_f) without a load, i = (V_S - K_m lambda_f w)/R with one. Catches: a field current
// taken for the flux, a saturation that has no effect. 20 s are 30 of the slowest time constants.
TEST(SeparateDcMachine, RunsAtTheSpeedOfItsVoltageOverItsFlux) {
  for (const SeparateDcMachineParameters& p : {kSeparate, saturated(kSeparate)}) {
    const SeparateDcMachineConstants c = constants_of(p);
    const double flux_wb = p.saturation_curve.empty() ? 2.0 * 20.0 : p.saturation_curve.value(2.0);
    Rig<SeparateDcMachineState> rig;
    const ShaftLoad frictionless{.inertia_kgm2 = 0.2};
    run(rig, 20.0, 1e-4, c, voltage(240.0, 200.0), frictionless);
    EXPECT_NEAR(rig.machine.field_flux_wb, flux_wb, 1e-9 * flux_wb);
    EXPECT_NEAR(rig.shaft.speed_rad_s, 240.0 / (0.03 * flux_wb), 1e-6);
    EXPECT_NEAR(rig.machine.i_a_a, 0.0, 1e-6);
    // RK4 at a step of L/R/100 leaves 1e-11 of the energy.
    EXPECT_NEAR(unaccounted_j(rig, c, frictionless), 0.0, 1e-9 * rig.energy.drawn_j);
    run(rig, 20.0, 1e-4, c, voltage(240.0, 200.0), {.inertia_kgm2 = 0.2, .load_nm = 36.0});
    EXPECT_NEAR(rig.machine.i_a_a, 36.0 / (0.03 * flux_wb), 1e-6);
    EXPECT_NEAR(rig.machine.i_a_a, (240.0 - 0.03 * flux_wb * rig.shaft.speed_rad_s) / 0.5, 1e-6);
  }
}

// DC-06: the field dies with L_f/R_f, and as it does the shaft runs away. Catches: a field that does not die,
// an emf that does not follow it.
TEST(SeparateDcMachine, RunsAwayWhenItLosesItsField) {
  const SeparateDcMachineConstants c = constants_of(kSeparate);
  const ShaftLoad frictionless{.inertia_kgm2 = 0.2};
  Rig<SeparateDcMachineState> rig;
  run(rig, 10.0, 1e-4, c, voltage(240.0, 200.0), frictionless);
  EXPECT_NEAR(rig.shaft.speed_rad_s, 200.0, 0.01);
  double before_rad_s = rig.shaft.speed_rad_s;
  for (int n = 1; n <= 8; ++n) {
    run(rig, 0.1, 1e-4, c, voltage(240.0, 0.0), frictionless);
    EXPECT_NEAR(rig.machine.field_flux_wb, 40.0 * std::exp(-0.5 * n), 1e-8) << n;
    EXPECT_GT(rig.shaft.speed_rad_s, before_rad_s) << n;
    EXPECT_LT(rig.shaft.speed_rad_s, 240.0 / (0.03 * rig.machine.field_flux_wb)) << n;
    before_rad_s = rig.shaft.speed_rad_s;
  }
  EXPECT_GT(rig.shaft.speed_rad_s, 2.0 * 200.0);
}

// DC-05 and DC-06. Catches: a sawtooth of wrong height, sign or period; a coupling that is on by itself; one
// with a mean. The gap in the power balance is the term itself, as the book's equations are not reciprocal.
TEST(SeparateDcMachine, FieldCouplingIsTheSawtoothOfTheCommutatorTimesTheChangeOfTheField) {
  SeparateDcMachineParameters p = kSeparate;
  p.armature_loops = 4;
  const SeparateDcMachineState x{.i_a_a = 30.0, .field_flux_wb = 25.0};
  const auto at = [](double angle_rad) { return motion_of({.speed_rad_s = 50.0, .angle_rad = angle_rad}); };
  const TerminalInput u = voltage(240.0, 300.0);
  const double plain = derivative(constants_of(p), x, at(0.3), u).i_a_a;
  p.field_coupling = true;
  const SeparateDcMachineConstants c = constants_of(p);
  const double quarter_rad = std::numbers::pi / 4.0;
  EXPECT_NEAR(commutator_sawtooth(c, 1e-12), std::numbers::pi / 2.0, 1e-10);
  EXPECT_NEAR(commutator_sawtooth(c, quarter_rad / 2.0), 0.0, 1e-12);
  EXPECT_NEAR(commutator_sawtooth(c, quarter_rad - 1e-12), -std::numbers::pi / 2.0, 1e-10);
  EXPECT_NEAR(commutator_sawtooth(c, quarter_rad + 1e-12), std::numbers::pi / 2.0, 1e-10);
  EXPECT_NEAR(commutator_sawtooth(c, -quarter_rad / 4.0), -std::numbers::pi / 4.0, 1e-12);
  const double field_slope = 300.0 - 100.0 * 25.0 / 20.0;
  const double induced_v = 0.03 / 4.0 * commutator_sawtooth(c, 0.3) * field_slope;
  EXPECT_NEAR(derivative(c, x, at(0.3), u).i_a_a - plain, induced_v / 5e-3, 1e-9);
  EXPECT_NEAR(unbalanced(c, x, at(0.3), u) * input_w(c, x, at(0.3), u), std::abs(30.0 * induced_v), 1e-4);
  double sum = 0.0;
  for (int n = 0; n < 1000; ++n)
    sum += commutator_sawtooth(c, quarter_rad * (n + 0.5) / 1000.0);
  EXPECT_NEAR(sum, 0.0, 1e-9);
}

// Catches: an open armature that drifts, a restriction that takes the field current as well, an adjustment of
// the wrong parameter.
TEST(SeparateDcMachine, OpensItsArmatureAloneAndAdjustsEachWindingByItsFactor) {
  const SeparateDcMachineConstants c = constants_of(kSeparate);
  const SeparateDcMachineState x{.i_a_a = 0.0, .field_flux_wb = 30.0};
  const RotorMotion motion = motion_of({.speed_rad_s = 100.0});
  const double emf_v = open_circuit_voltages(c, x, motion).stator.a;
  EXPECT_NEAR(emf_v, 90.0, 1e-12);
  EXPECT_NEAR(derivative(c, x, motion, voltage(emf_v)).i_a_a, 0.0, 1e-12);
  const SeparateDcMachineState open = derivative(c, x, motion, open_terminals(200.0));
  EXPECT_EQ(open.i_a_a, 0.0);
  EXPECT_NEAR(open.field_flux_wb, 50.0, 1e-12);
  const SeparateDcMachineState rest =
      restricted(c, {.i_a_a = 5.0, .field_flux_wb = 30.0}, motion, open_terminals());
  EXPECT_EQ(rest.i_a_a, 0.0);
  EXPECT_EQ(rest.field_flux_wb, 30.0);
  EXPECT_EQ(restricted(c, {.i_a_a = 5.0}, motion, voltage(0.0)).i_a_a, 5.0);
  const SeparateDcMachineParameters p = adjusted(kSeparate, {.stator_resistance_factor = 1.5,
                                                             .rotor_resistance_factor = 2.0,
                                                             .series_resistance_ohm = 0.25,
                                                             .series_inductance_h = 1e-3});
  EXPECT_DOUBLE_EQ(p.armature_resistance_ohm, 1.0);
  EXPECT_DOUBLE_EQ(p.armature_inductance_h, 6e-3);
  EXPECT_DOUBLE_EQ(p.field_resistance_ohm, 200.0);
  EXPECT_DOUBLE_EQ(fastest_time_constant_s(p), 6e-3);
  EXPECT_EQ(connection_of(p), Connection::kArmature);
  EXPECT_EQ(pole_pairs_of(p), 0.0);
}

/// Speed and flux of the shunt machine of the book without armature inductance, by its equations.
struct ReducedShunt {
  double speed_rad_s = 0.0;
  double flux_wb = 0.0;
};

/// Largest distance in speed between shunt machine and reduced model during the start.
double distance_rad_s(double inductance_h) {
  ShuntDcMachineParameters p = saturated(kShunt);
  p.armature_inductance_h = inductance_h;
  const ShuntDcMachineConstants c = constants_of(p);
  const double step_s = 0.1 * inductance_h / 0.5;
  constexpr double kVoltage_v = 240.0;
  constexpr double kLoad_nm = 5.0;
  Rig<ShuntDcMachineState> rig;
  ReducedShunt reduced;
  double worst = 0.0;
  for (long k = 0; k < std::lround(0.5 / step_s); ++k) {
    step(rig, step_s, c, voltage(kVoltage_v), {.inertia_kgm2 = 0.2, .load_nm = kLoad_nm});
    reduced = rk4_step(reduced, step_s, [&p](const ReducedShunt& x) -> ReducedShunt {
      const double k_m = 0.03;
      const double per_jr = 1.0 / (0.2 * 0.5);
      return {-k_m * k_m * per_jr * x.flux_wb * x.flux_wb * x.speed_rad_s +
                  k_m * per_jr * x.flux_wb * kVoltage_v - kLoad_nm / 0.2,
              -100.0 * p.saturation_curve.inverse(x.flux_wb) + kVoltage_v};
    });
    worst = std::max(worst, std::abs(rig.shaft.speed_rad_s - reduced.speed_rad_s));
  }
  return worst;
}

// DC-09. Catches: a wrong factor K_m/(J R), a field that is not fed by the terminals. The distance is of
// first order in L: 10 times less inductance, 10 times less of it, but for the next order.
TEST(ShuntDcMachine, TendsToTheReducedModelOfTheBookAsTheArmatureInductanceGoesToZero) {
  const double distance = distance_rad_s(1e-3);
  EXPECT_LT(distance, 2.0);
  EXPECT_NEAR(distance_rad_s(1e-4) / distance, 0.1, 0.001);
}

// Catches: an adjusting resistor that acts elsewhere, a terminal current without that of the field.
TEST(ShuntDcMachine, DrawsArmatureAndFieldCurrentAndRunsFasterWithAWeakerField) {
  ShuntDcMachineParameters p = kShunt;
  for (const double adjusting_ohm : {0.0, 20.0, 80.0}) {
    p.adjusting_resistance_ohm = adjusting_ohm;
    const double field_a = 240.0 / (80.0 + adjusting_ohm);
    const double constant = 0.03 * 20.0 * field_a;
    const ShuntDcMachineConstants c = constants_of(p);
    Rig<ShuntDcMachineState> rig;
    run(rig, 20.0, 1e-4, c, voltage(240.0), {.inertia_kgm2 = 0.2, .load_nm = 30.0});
    const WindingValues current = winding_currents(c, rig.machine, motion_of(rig.shaft));
    EXPECT_NEAR(current.field, field_a, 1e-9);
    EXPECT_NEAR(current.stator.a, 30.0 / constant + field_a, 1e-6);
    EXPECT_NEAR(rig.shaft.speed_rad_s, (240.0 - 0.5 * 30.0 / constant) / constant, 1e-6);
  }
}

/// A generator that is turned at a speed with open terminals, from a little flux, for 30 s.
Rig<ShuntDcMachineState> excited(const ShuntDcMachineConstants& c, double speed_rad_s, double flux_wb) {
  Rig<ShuntDcMachineState> rig;
  rig.shaft.speed_rad_s = speed_rad_s;
  rig.machine =
      restricted(c, {.armature_a = 0.0, .field_flux_wb = flux_wb}, motion_of(rig.shaft), open_terminals());
  run(rig, 30.0, 1e-4, c, open_terminals(), kFlywheel);
  return rig;
}

// Open terminals. Catches: a loop current of the wrong sign (nothing would build up, or the wrong way round),
// a terminal current. The machine excites itself above the speed (R + R_F)/(K_m 32 H) = 104.7 rad/s of the
// steepest part of the curve, until the emf is the voltage drop of the loop.
TEST(ShuntDcMachine, WithOpenTerminalsExcitesItselfAboveItsCriticalSpeedUntilItSaturates) {
  const ShuntDcMachineConstants c = constants_of(saturated(kShunt));
  const Curve curve = wound_saturation();
  for (const double start_wb : {0.5, -0.5}) {
    const Rig<ShuntDcMachineState> rig = excited(c, 160.0, start_wb);
    const WindingValues current = winding_currents(c, rig.machine, motion_of(rig.shaft));
    EXPECT_GT(current.field * start_wb, 0.0);
    const double field_a = std::abs(current.field);
    EXPECT_GT(field_a, 1.0);
    EXPECT_NEAR(0.03 * curve.value(field_a) * 160.0, 100.5 * field_a, 1e-5);
    EXPECT_NEAR(current.stator.a, 0.0, 1e-9);
    EXPECT_NEAR(std::abs(open_circuit_voltages(c, rig.machine, motion_of(rig.shaft)).stator.a),
                100.0 * field_a, 1e-6);
  }
  EXPECT_LT(std::abs(excited(c, 100.0, 5.0).machine.field_flux_wb), 1.0);
  EXPECT_LT(std::abs(excited(c, -160.0, 5.0).machine.field_flux_wb), 1e-6);
}

// Catches: energy from nowhere while the machine excites itself and brakes the shaft by it. RK4 leaves 1e-5 J
// of 2560 J where the loop crosses a kink of the curve.
TEST(ShuntDcMachine, WithOpenTerminalsTheEnergyOfTheShaftGoesIntoFieldAndLosses) {
  const ShuntDcMachineConstants c = constants_of(saturated(kShunt));
  Rig<ShuntDcMachineState> rig;
  rig.shaft.speed_rad_s = 160.0;
  rig.machine =
      restricted(c, {.armature_a = 0.0, .field_flux_wb = 10.0}, motion_of(rig.shaft), open_terminals());
  const double before_j = unaccounted_j(rig, c, kShaft);
  run(rig, 2.0, 1e-4, c, open_terminals(), kShaft);
  EXPECT_GT(rig.energy.copper_j, 100.0);
  EXPECT_EQ(rig.energy.drawn_j, 0.0);
  EXPECT_NEAR(unaccounted_j(rig, c, kShaft), before_j, 1e-4);
}

// Catches: an opening that makes energy, or that changes the linkage of the loop; a voltage of open terminals
// that drives a current.
TEST(ShuntDcMachine, OpeningTheTerminalsKeepsTheLinkageOfTheLoopAndMakesNoEnergy) {
  for (const ShuntDcMachineConstants& c : {constants_of(kShunt), constants_of(saturated(kShunt))}) {
    RandomStates random(25);
    for (int n = 0; n < 1000; ++n) {
      const ShuntDcMachineState x{.armature_a = random.draw(80.0), .field_flux_wb = random.draw(60.0)};
      const RotorMotion motion = random.motion();
      const ShuntDcMachineState open = restricted(c, x, motion, open_terminals());
      ASSERT_NEAR(winding_currents(c, open, motion).stator.a, 0.0, 1e-12);
      ASSERT_NEAR(open.field_flux_wb - 5e-3 * open.armature_a, x.field_flux_wb - 5e-3 * x.armature_a, 1e-12);
      ASSERT_LE(stored_energy_j(c, open, motion), stored_energy_j(c, x, motion));
      const ShuntDcMachineState connected =
          derivative(c, open, motion, voltage(open_circuit_voltages(c, open, motion).stator.a));
      const ShuntDcMachineState apart = derivative(c, open, motion, open_terminals());
      ASSERT_NEAR(connected.armature_a, apart.armature_a, 1e-8);
      ASSERT_NEAR(connected.field_flux_wb, apart.field_flux_wb, 1e-10);
    }
    EXPECT_EQ(restricted(c, {.armature_a = 5.0}, motion_of({}), voltage(0.0)).armature_a, 5.0);
  }
}

// Catches: an adjustment of the wrong winding or of the adjusting resistor, a field that is forgotten when
// the substep is chosen.
TEST(ShuntDcMachine, AdjustsEachWindingByItsFactor) {
  const ShuntDcMachineParameters p = adjusted(kShunt, {.stator_resistance_factor = 1.5,
                                                       .rotor_resistance_factor = 2.0,
                                                       .series_resistance_ohm = 0.25,
                                                       .series_inductance_h = 1e-3});
  EXPECT_DOUBLE_EQ(p.armature_resistance_ohm, 1.0);
  EXPECT_DOUBLE_EQ(p.armature_inductance_h, 6e-3);
  EXPECT_DOUBLE_EQ(p.field_resistance_ohm, 160.0);
  EXPECT_DOUBLE_EQ(p.adjusting_resistance_ohm, 20.0);
  EXPECT_DOUBLE_EQ(fastest_time_constant_s(p), 6e-3);
  ShuntDcMachineParameters stiff = saturated(kShunt);
  stiff.field_resistance_ohm = 980.0;
  EXPECT_DOUBLE_EQ(fastest_time_constant_s(stiff), 6.0 / 1.6 / 1000.0);
  EXPECT_DOUBLE_EQ(rotor_flux_wb(constants_of(p), {.field_flux_wb = 3.0}, motion_of({})).a, 3.0);
  EXPECT_EQ(connection_of(p), Connection::kArmature);
  EXPECT_EQ(pole_pairs_of(p), 0.0);
}

}  // namespace
}  // namespace drivebench::wound_dc_machine_test
