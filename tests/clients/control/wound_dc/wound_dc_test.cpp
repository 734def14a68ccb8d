// The laws for machines with a wound field, one by one: the voltage that a law gives in a state, put into the
// machine's own equations, must move the last coordinate of the chain as the law wants it. The speed comes
// from a tachometer, so that every state can be shown to the law.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>

#include "clients/control/wound_dc/separate_dc_control.hpp"
#include "clients/control/wound_dc/series_dc_control.hpp"
#include "clients/control/wound_dc/series_dc_observer.hpp"
#include "clients/control/wound_dc/shunt_dc_control.hpp"

namespace drivebench::control::wound_dc_test {
namespace {

constexpr WoundDcModel kSeparate = {.armature_resistance_ohm = 3.0,
                                    .armature_inductance_h = 0.03,
                                    .motor_constant = 0.05,
                                    .field_resistance_ohm = 220.0,
                                    .field_flux_scale = 1.0,
                                    .field_shunt_resistance_ohm = 0.0,
                                    .inertia_kgm2 = 0.02,
                                    .friction_nms = 0.004,
                                    .field = FieldCurve::linear(23.0)};
constexpr WoundDcModel kSeries = {.armature_resistance_ohm = 1.5,
                                  .armature_inductance_h = 0.01,
                                  .motor_constant = 1.2,
                                  .field_resistance_ohm = 1.0,
                                  .field_flux_scale = 1.0,
                                  .field_shunt_resistance_ohm = 0.0,
                                  .inertia_kgm2 = 0.02,
                                  .friction_nms = 0.004,
                                  .field = FieldCurve::linear(0.12)};

constexpr WoundDcAxisParameters axis_of(const WoundDcModel& machine) noexcept {
  return {
      .machine = machine,
      .sample_rate_hz = 10e3,
      .voltage_limit_v = 1e9,
      .current_limit_a = 100.0,
      .field_voltage_limit_v = 1e9,
      .least_flux_wb = 1e-3,
      .shaft = {
          .counts_per_revolution = 2000.0, .source = ShaftSpeed::kTachometer, .tachometer_vs_per_rad = 1.0}};
}

/// Armature current, speed and field flux.
struct State {
  double i_a;
  double w;
  double flux;
};

/// The slope of a function of the state along the motion x' in which the machine is.
double slope_of(const std::function<double(const State&)>& f, const State& x, const State& slope) {
  constexpr double kStep = 1e-7;
  const auto at = [&](double s) {
    return f({x.i_a + s * slope.i_a, x.w + s * slope.w, x.flux + s * slope.flux});
  };
  return (at(kStep) - at(-kStep)) / (2.0 * kStep);
}

constexpr Reference kWanted = {.speed_rad_s = 130.0, .acceleration_rad_s2 = 40.0, .jerk_rad_s3 = 7.0};

// CTL-08. Catches: a term of the decoupling that is missing or has the wrong sign: the book prints one wrong.
// dω/dt's slope must be v1 and the flux must have its rate, in any state.
TEST(SeparateDc, BothChainsAreLinear) {
  const SeparateDcParameters p = {.axis = axis_of(kSeparate),
                                  .flux = {.rated_flux_wb = 20.0, .base_speed_rad_s = 100.0},
                                  .flux_per_s = 20.0,
                                  .speed = ServoGains::placed(placed_polynomial<3>({30.0, 40.0, 50.0}))};
  for (const State& x : {State{4.0, 120.0, 15.0}, State{-3.0, 150.0, 8.0}, State{0.0, -20.0, 21.0}}) {
    SeparateDcController controller(p);
    const double i_f = x.flux / 23.0;
    const Setpoint u = controller.update({.tachometer_v = x.w, .i_a_a = x.i_a, .i_f_a = i_f}, kWanted, 1);
    const auto acceleration = [](const State& s) {
      return (kSeparate.motor_constant * s.flux * s.i_a - kSeparate.friction_nms * s.w) /
             kSeparate.inertia_kgm2;
    };
    const State slope = {.i_a = (u.a - 3.0 * x.i_a - 0.05 * x.flux * x.w) / 0.03,
                         .w = acceleration(x),
                         .flux = u.field - 220.0 * i_f};
    const double v1 = p.speed.proportional_per_s2 * (130.0 - x.w) +
                      p.speed.derivative_per_s * (40.0 - acceleration(x)) + 7.0;
    EXPECT_NEAR(slope_of(acceleration, x, slope), v1, 1e-5 * std::abs(v1));
    // λ_ref = 20·100/130 and falls with the speed.
    const double wanted_flux = 20.0 * 100.0 / 130.0;
    EXPECT_NEAR(slope.flux, 20.0 * (wanted_flux - x.flux) - wanted_flux * 40.0 / 130.0, 1e-9);
  }
}

// CTL-08 at the limit of the field supply. Catches: an armature that reckons with the field voltage it asked
// for.
TEST(SeparateDc, TheArmatureUsesTheLimitedFieldVoltage) {
  SeparateDcParameters p = {.axis = axis_of(kSeparate),
                            .flux = {.rated_flux_wb = 20.0, .base_speed_rad_s = 1000.0},
                            .flux_per_s = 50.0,
                            .speed = ServoGains::placed(placed_polynomial<3>({30.0, 40.0, 50.0}))};
  p.axis.field_voltage_limit_v = 150.0;
  SeparateDcController controller(p);
  const State x = {.i_a = 5.0, .w = 120.0, .flux = 10.0};
  const Setpoint u =
      controller.update({.tachometer_v = x.w, .i_a_a = x.i_a, .i_f_a = 10.0 / 23.0}, kWanted, 1);
  EXPECT_EQ(u.field, 150.0);
  EXPECT_TRUE(controller.saturated());
  const auto acceleration = [](const State& s) {
    return (kSeparate.motor_constant * s.flux * s.i_a - kSeparate.friction_nms * s.w) /
           kSeparate.inertia_kgm2;
  };
  const State slope = {.i_a = (u.a - 3.0 * x.i_a - 0.05 * x.flux * x.w) / 0.03,
                       .w = acceleration(x),
                       .flux = 150.0 - 220.0 * 10.0 / 23.0};
  const double v1 =
      p.speed.proportional_per_s2 * 10.0 + p.speed.derivative_per_s * (40.0 - acceleration(x)) + 7.0;
  EXPECT_NEAR(slope_of(acceleration, x, slope), v1, 1e-5 * std::abs(v1));
}

// CTL-09. Catches: a slip in the third derivative of the energy (the book's second line is misprinted): z3'
// must be what the energy loop wants.
TEST(SeparateDc, TheFieldAloneMakesTheEnergyAChainOfThree) {
  const double v_a0 = 220.0;
  const FieldControlDcParameters p = {.axis = axis_of(kSeparate),
                                      .armature_voltage_v = v_a0,
                                      .rated_flux_wb = 20.0,
                                      .start_speed_rad_s = 100.0,
                                      .energy_integral_per_s4 = 100.0,
                                      .energy_proportional_per_s3 = 500.0,
                                      .power_per_s2 = 150.0,
                                      .power_slope_per_s = 20.0};
  for (const State& x : {State{4.0, 150.0, 15.0}, State{12.0, 120.0, 20.0}, State{-2.0, 210.0, 12.0}}) {
    FieldControlDcController controller(p);
    const double i_f = x.flux / 23.0;
    const Measurement seen = {.tachometer_v = x.w, .i_a_a = x.i_a, .i_f_a = i_f};
    controller.update(seen, kWanted, 1);  // the start, which ends as the reference is beyond it
    const Setpoint u = controller.update(seen, kWanted, 1);
    EXPECT_EQ(u.a, v_a0);
    const auto current_slope = [&](const State& s) {
      return (v_a0 - 3.0 * s.i_a - 0.05 * s.flux * s.w) / 0.03;
    };
    const auto z3 = [&](const State& s) { return (v_a0 - 6.0 * s.i_a) * current_slope(s); };
    const State slope = {.i_a = current_slope(x),
                         .w = (0.05 * x.flux * x.i_a - 0.004 * x.w) / 0.02,
                         .flux = u.field - 220.0 * i_f};
    const double energy = 0.5 * (0.03 * x.i_a * x.i_a + 0.02 * x.w * x.w);
    const double wanted = 500.0 * (0.01 * 130.0 * 130.0 - energy) +
                          150.0 * (0.02 * 130.0 * 40.0 - x.i_a * (v_a0 - 3.0 * x.i_a)) +
                          20.0 * (0.02 * (40.0 * 40.0 + 130.0 * 7.0) - z3(x));
    // The first update has already added a sample of the energy error to the integral, which K0 sees.
    EXPECT_NEAR(slope_of(z3, x, slope), wanted, 1e-4 * std::abs(wanted) + 100.0);
  }
}

// CTL-10. Catches: the armature's own inductance forgotten or torque taken linear in the current:
// 2·K_m·L_f·i.
TEST(SeriesDc, TheAccelerationIsAChainOfTwo) {
  const SeriesDcParameters p = {.axis = axis_of(kSeries),
                                .least_current_a = 0.5,
                                .speed = ServoGains::placed(placed_polynomial<3>({15.0, 20.0, 25.0}))};
  for (const State& x : {State{4.0, 120.0, 0.48}, State{9.0, 30.0, 1.08}, State{0.6, 140.0, 0.072}}) {
    SeriesDcController controller(p);
    const Setpoint u = controller.update({.tachometer_v = x.w, .i_a_a = x.i_a}, kWanted, 1);
    const auto acceleration = [](const State& s) {
      return (1.2 * 0.12 * s.i_a * s.i_a - 0.004 * s.w) / 0.02;
    };
    const State slope = {
        .i_a = (u.a - 2.5 * x.i_a - 1.2 * 0.12 * x.i_a * x.w) / 0.13, .w = acceleration(x), .flux = 0.0};
    const double v1 = p.speed.proportional_per_s2 * (130.0 - x.w) +
                      p.speed.derivative_per_s * (40.0 - acceleration(x)) + 7.0;
    EXPECT_NEAR(slope_of(acceleration, x, slope), v1, 1e-5 * std::abs(v1));
  }
}

// CTL-10. Catches: a start that never begins (a division by no current) and a brake that reverses the
// current: the torque would be positive again.
TEST(SeriesDc, StartsFromNoCurrentAndNeverReversesIt) {
  SeriesDcController controller({.axis = axis_of(kSeries),
                                 .least_current_a = 0.5,
                                 .speed = ServoGains::placed(placed_polynomial<3>({15.0, 15.0, 15.0}))});
  const double start_v = controller.update({}, kWanted, 1).a;
  EXPECT_GT(start_v, 0.0);
  EXPECT_TRUE(std::isfinite(start_v));
  EXPECT_EQ(controller.update({.tachometer_v = 300.0}, kWanted, 1).a, 0.0);
  EXPECT_LT(controller.update({.tachometer_v = 300.0, .i_a_a = 2.0}, kWanted, 1).a, 0.0);
}

// CTL-11. Catches: R_p with the wrong sign, a torque that does not come: with the resistor across the field
// the current that follows must give v1, and v1 stays between what the two fluxes stand for.
TEST(SeriesDc, TheWeakenedMotorGetsItsAcceleration) {
  WoundDcModel m = kSeries;
  m.field_shunt_resistance_ohm = 4.0;
  WeakenedSeriesDcParameters p = {.axis = axis_of(m),
                                  .most_flux_wb = 2.0,
                                  .speed_proportional_per_s = 10.0,
                                  .speed_integral_per_s2 = 25.0};
  p.axis.least_flux_wb = 0.1;
  EXPECT_TRUE(p.problems().empty());
  const double i_f = 4.0;
  const auto acceleration_at = [&](double w) {
    WeakenedSeriesDcController controller(p);
    const double v = controller.update({.tachometer_v = w, .i_a_a = 5.0, .i_f_a = i_f}, kWanted, 1).a;
    const double i = (v + 4.0 * i_f - 1.2 * 0.12 * i_f * w) / 5.5;  // without L
    return 1.2 * 0.12 * i_f * i / 0.02;
  };
  EXPECT_NEAR(acceleration_at(120.0), 40.0 + 10.0 * 10.0, 1e-9);
  // λ² = v1·J·R_p·L_f/(K_m·(R_p + R_f)): 2 Wb are 2500 rad/s², 0.1 Wb 6.25.
  EXPECT_NEAR(acceleration_at(-400.0), 2500.0, 1e-6);
  EXPECT_NEAR(acceleration_at(200.0), 6.25, 1e-9);
  p.axis.machine.field_shunt_resistance_ohm = 0.0;
  EXPECT_EQ(p.problems().size(), 1u);
}

// Catches: an integral that goes on while the acceleration or the field voltage stands at its limit: what
// follows must be what a fresh controller does.
TEST(SeriesDc, TheWeakenedMotorsIntegralStandsStillAtTheLimitOfItsFlux) {
  WeakenedSeriesDcParameters p = {.axis = axis_of(kSeries),
                                  .most_flux_wb = 2.0,
                                  .speed_proportional_per_s = 10.0,
                                  .speed_integral_per_s2 = 25.0};
  p.axis.machine.field_shunt_resistance_ohm = 4.0;
  p.axis.least_flux_wb = 0.1;
  const Measurement slow = {.tachometer_v = -400.0, .i_a_a = 5.0, .i_f_a = 4.0};
  const Measurement right = {.tachometer_v = 130.0, .i_a_a = 5.0, .i_f_a = 4.0};
  WeakenedSeriesDcController fresh(p);
  WeakenedSeriesDcController old(p);
  for (int k = 0; k < 1000; ++k)
    old.update(slow, kWanted, 1);
  EXPECT_EQ(old.update(right, kWanted, 1).a, fresh.update(right, kWanted, 1).a);
}

TEST(SeparateDc, TheEnergyIntegralStandsStillAtTheLimitOfTheField) {
  FieldControlDcParameters p = {.axis = axis_of(kSeparate),
                                .armature_voltage_v = 220.0,
                                .rated_flux_wb = 20.0,
                                .start_speed_rad_s = 100.0,
                                .energy_integral_per_s4 = 625.0,
                                .energy_proportional_per_s3 = 500.0,
                                .power_per_s2 = 150.0,
                                .power_slope_per_s = 20.0};
  p.axis.field_voltage_limit_v = 300.0;
  const Measurement slow = {.tachometer_v = 20.0, .i_a_a = 5.0, .i_f_a = 0.8};
  const Measurement right = {.tachometer_v = 215.0, .i_a_a = 3.0, .i_f_a = 0.8};
  const Reference wanted = {.speed_rad_s = 216.0};
  FieldControlDcController fresh(p);
  FieldControlDcController old(p);
  fresh.update(right, wanted, 1);
  old.update(slow, wanted, 1);
  for (int k = 0; k < 1000; ++k) {
    EXPECT_EQ(old.update(slow, wanted, 1).field, -300.0);
  }
  const double field_v = fresh.update(right, wanted, 1).field;
  EXPECT_LT(std::abs(field_v), 300.0);
  EXPECT_EQ(old.update(right, wanted, 1).field, field_v);
}

/// The reduced shunt machine, L = 0: ω' and λ' under a voltage.
State shunt_slope(const WoundDcModel& m, const State& x, double u, double load_nm) {
  const double i = (u - m.motor_constant * x.flux * x.w) / m.armature_resistance_ohm;
  return {.i_a = 0.0,
          .w = (m.motor_constant * x.flux * i - load_nm) / m.inertia_kgm2,
          .flux = u - m.field_resistance_ohm * x.flux / 23.0};
}

// CTL-12. Catches: a slip in α or β (the reference gives both): along the reduced machine z1' = z2 − τ_L/J
// and z2' = α + β·u + (K_m²/(J·R))·λ²·τ_L/J, for any voltage and load.
TEST(ShuntDc, TheExactChainIsThatOfTheReducedMachine) {
  for (const State& x : {State{0.0, 100.0, 8.0}, State{0.0, 40.0, 20.0}, State{0.0, -30.0, 5.0}}) {
    for (const double u : {0.0, 80.0, -120.0}) {
      for (const double load_nm : {0.0, 3.0}) {
        const State slope = shunt_slope(kSeparate, x, u, load_nm);
        const ShuntDcChain c = ShuntDcChain::at(kSeparate, x.flux, x.w);
        const auto z1 = [](const State& s) { return ShuntDcChain::at(kSeparate, s.flux, s.w).z1_rad_s; };
        const auto z2 = [](const State& s) { return ShuntDcChain::at(kSeparate, s.flux, s.w).z2_rad_s2; };
        const double load = load_nm / 0.02;
        EXPECT_NEAR(slope_of(z1, x, slope), c.z2_rad_s2 - load, 1e-4);
        EXPECT_NEAR(slope_of(z2, x, slope),
                    c.alpha_rad_s3 + c.beta_rad_s3_per_v * u + c.load_gain_per_s * load, 1e-2);
      }
    }
  }
  // At the flux that holds a speed under a load nothing moves at the voltage that holds the flux.
  const double flux = ShuntDcChain::holding_flux_wb(kSeparate, 100.0, 5.0);
  const State rest = shunt_slope(kSeparate, {0.0, 100.0, flux}, 220.0 * flux / 23.0, 5.0);
  EXPECT_NEAR(rest.w, 0.0, 1e-9);
  EXPECT_NEAR(rest.flux, 0.0, 1e-9);
}

// CTL-13. Catches: a voltage that does not give the wanted acceleration, and a shunt current taken for that
// of the armature.
TEST(ShuntDc, InputAndOutputAreLinear) {
  const ShuntDcParameters p = {
      .axis = axis_of(kSeparate), .speed_proportional_per_s = 10.0, .speed_integral_per_s2 = 25.0};
  ShuntDcController controller(p);
  const State x = {.i_a = 0.0, .w = 90.0, .flux = 11.5};
  const double u = controller.update({.tachometer_v = 90.0, .i_a_a = 6.5, .i_f_a = 0.5}, kWanted, 1).a;
  EXPECT_NEAR(shunt_slope(kSeparate, x, u, 0.0).w, 40.0 + 10.0 * 40.0, 1e-9);
}

// Catches: a curve that is not odd, a slope beside its piece, and a last piece that ends.
TEST(FieldCurve, IsOddAndContinuesBeyondItsLastPoint) {
  constexpr FieldCurve kCurve = {.points = {{{0.0, 0.0}, {0.5, 10.0}, {1.0, 15.0}}}, .count = 3};
  EXPECT_DOUBLE_EQ(kCurve.flux_wb(0.25), 5.0);
  EXPECT_DOUBLE_EQ(kCurve.flux_wb(-0.75), -12.5);
  EXPECT_DOUBLE_EQ(kCurve.flux_wb(2.0), 25.0);
  EXPECT_DOUBLE_EQ(kCurve.slope_h(0.25), 20.0);
  EXPECT_DOUBLE_EQ(kCurve.slope_h(-0.75), 10.0);
}

/// A series motor of the model, stepped so finely that it is exact, and the observer at 10 kHz beside it.
struct SensorlessRun {
  double current_a = 3.0;
  double speed_rad_s = 40.0;
  double voltage_v = 60.0;
  double load_nm = 1.0;

  void run(SeriesDcObserver& observer, double duration_s) {
    for (int k = 0; k < duration_s * 1e4; ++k) {
      for (int n = 0; n < 20; ++n) {
        constexpr double kStep_s = 5e-6;
        const double i_slope = (voltage_v - 2.5 * current_a - 1.2 * 0.12 * current_a * speed_rad_s) / 0.13;
        const double middle_a = current_a + 0.5 * kStep_s * i_slope;
        const double w_slope = (1.2 * 0.12 * middle_a * middle_a - 0.004 * speed_rad_s - load_nm) / 0.02;
        const double middle_w = speed_rad_s + 0.5 * kStep_s * w_slope;
        current_a += kStep_s * (voltage_v - 2.5 * middle_a - 1.2 * 0.12 * middle_a * middle_w) / 0.13;
        speed_rad_s += kStep_s * w_slope;
      }
      observer.update(current_a, voltage_v, 1);
    }
  }
};

// EST-05, EST-06. Catches: gains with K_m on the wrong side: the polynomial must have its roots where they
// were placed. And the speed must come from the current alone, the load as well if it is asked for.
TEST(SeriesDcObserver, FindsSpeedAndLoadFromTheCurrent) {
  const auto gains = SeriesDcObserverGains::placed(std::array{40.0, 50.0, 60.0}, kSeries);
  const Polynomial<3> c = characteristic_polynomial(series_dc_observer(kSeries, gains).error_matrix());
  EXPECT_NEAR(c[0], 150.0, 1e-9);
  EXPECT_NEAR(c[1], 7400.0, 1e-6);
  EXPECT_NEAR(c[2], 120000.0, 1e-3);
  SeriesDcObserver observer(kSeries, gains, 0.5, 1e-4, Discretisation::kExact);
  EXPECT_TRUE(observer.stable());
  SensorlessRun motor;
  motor.run(observer, 1.0);
  EXPECT_NEAR(observer.speed_rad_s(), motor.speed_rad_s, 0.05);
  EXPECT_NEAR(observer.load_nm(), 1.0, 0.005);
  motor.voltage_v = 20.0;  // a quick change of the current is no change of the speed
  motor.run(observer, 0.02);
  EXPECT_NEAR(observer.speed_rad_s(), motor.speed_rad_s, 0.2);
  motor.load_nm = 1.2;
  motor.voltage_v = 60.0;
  motor.run(observer, 1.0);
  EXPECT_NEAR(observer.load_nm(), 1.2, 0.005);
}

// Catches: a voltage that is taken a sample too late: at 2000 V/s that would be 0.2 V, and 0.16 rad/s.
TEST(SeriesDcObserver, UsesTheVoltageOfTheSampleBefore) {
  SeriesDcObserver observer(kSeries, SeriesDcObserverGains::placed(std::array{40.0, 50.0, 60.0}, kSeries),
                            0.5, 1e-4, Discretisation::kTrapezoidal);
  SensorlessRun motor;
  motor.run(observer, 1.0);
  double peak_rad_s = 0.0;
  for (int k = 0; k < 500; ++k) {
    motor.voltage_v += 0.2;
    motor.run(observer, 1e-4);
    peak_rad_s = std::max(peak_rad_s, std::abs(observer.speed_rad_s() - motor.speed_rad_s));
  }
  EXPECT_LT(peak_rad_s, 0.1);
}

// EST-05. Catches: a load that an observer without one finds all the same, and a speed that is wrong then.
TEST(SeriesDcObserver, WithoutALoadItFindsTheSpeedAlone) {
  const auto gains = SeriesDcObserverGains::placed(std::array{50.0, 60.0}, kSeries);
  SeriesDcObserver observer(kSeries, gains, 0.5, 1e-4, Discretisation::kTrapezoidal);
  SensorlessRun motor = {.load_nm = 0.0};
  motor.run(observer, 1.0);
  EXPECT_NEAR(observer.speed_rad_s(), motor.speed_rad_s, 0.1);
  EXPECT_EQ(observer.load_nm(), 0.0);
  EXPECT_TRUE(observer.stable());
}

// Catches: a logarithm of no current: the estimates stand still, and go on from there.
TEST(SeriesDcObserver, StandsStillWithoutCurrent) {
  SeriesDcObserver observer(kSeries, SeriesDcObserverGains::placed(std::array{40.0, 40.0, 40.0}, kSeries),
                            0.5, 1e-4, Discretisation::kEuler);
  SensorlessRun motor;
  motor.run(observer, 1.0);
  const double speed_rad_s = observer.speed_rad_s();
  for (int k = 0; k < 100; ++k)
    observer.update(0.0, 0.0, 1);
  EXPECT_EQ(observer.speed_rad_s(), speed_rad_s);
  motor.run(observer, 0.5);
  EXPECT_NEAR(observer.speed_rad_s(), motor.speed_rad_s, 0.2);
}

}  // namespace
}  // namespace drivebench::control::wound_dc_test
