#include "plant/drive/supply/transformer.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>
#include <random>

#include "plant/axis.hpp"
#include "tests/plant/drive_rig.hpp"

namespace drivebench::transformer_test {
namespace {

using Complex = std::complex<double>;

constexpr double kOmega_rad_s = 2.0 * std::numbers::pi * 50.0;

/// A transformer of large leakage and winding resistance, so that an error in any of its terms shows.
constexpr TransformerParameters kWeak = {.turns_ratio = 0.4,
                                         .primary_resistance_ohm = 3.0,
                                         .primary_leakage_h = 20e-3,
                                         .magnetising_inductance_h = 150e-3,
                                         .secondary_resistance_ohm = 0.5,
                                         .secondary_leakage_h = 2e-3};

/// Secondary current per volt of the source at s, into a load R_L + s·L_L: the transfer function of GRID-01
/// with R_2 + s·L_l2 + R_L + s·L_L in the place of R_2 + s·L_l2 + R_L.
Complex current_per_volt(const TransformerParameters& t, RigLoad load, Complex s) {
  const double n = t.turns_ratio;
  const double m = t.magnetising_inductance_h;
  const double r1 = t.primary_resistance_ohm;
  const double l1 = t.primary_leakage_h;
  const double r2 = t.secondary_resistance_ohm + load.resistance_ohm;
  const double l2 = t.secondary_leakage_h + load.inductance_h;
  return s * n * m / ((r1 + s * (l1 + m)) * (r2 + s * l2) + s * n * n * m * (r1 + s * l1));
}

/// The same through the state and the impedance of the model.
Complex current_of_model(const TransformerParameters& t, RigLoad load, Complex s) {
  const TransformerConstants c = constants_of(t);
  const Complex z = c.resistance_ohm + load.resistance_ohm + s * (c.inductance_h + load.inductance_h);
  // s·λ = 1 − a·λ − b·i and z·i = gain·(1 − a·λ), solved for i.
  const Complex rest = s / (s + c.decay_per_s);
  return c.gain * rest / (z - c.gain * c.coupling_ohm * c.decay_per_s / (s + c.decay_per_s));
}

// GRID-01 with its numbers of terms: G = b1 s/(a2 s² + a1 s + a0) for a load R_L.
// Catches: an error of the transfer function that the other tests use.
TEST(Transformer, TheTransferFunctionIsTheBooksForAResistiveLoad) {
  const TransformerParameters& t = kWeak;
  const double n = t.turns_ratio, r1 = t.primary_resistance_ohm, r2 = t.secondary_resistance_ohm;
  const double ll1 = t.primary_leakage_h, ll2 = t.secondary_leakage_h, lm = t.magnetising_inductance_h;
  const double rl = 7.0;
  const double a0 = r1 * r2 + r1 * rl;
  const double a1 = ll2 * r1 + lm * r1 * n * n + ll1 * r2 + lm * r2 + ll1 * rl + lm * rl;
  const double a2 = ll1 * ll2 + ll2 * lm + ll1 * lm * n * n;
  const double b1 = n * rl * lm;
  for (const double omega : {1.0, 300.0, 1e5}) {
    const Complex s(0.0, omega);
    const Complex book = b1 * s / (a2 * s * s + a1 * s + a0);
    const Complex ours = rl * current_per_volt(t, {.resistance_ohm = rl, .inductance_h = 0.0}, s);
    EXPECT_NEAR(std::abs(ours / book - 1.0), 0.0, 1e-13) << omega;
  }
}

// In random transformers and at random complex frequencies, to rounding. Catches: a turns ratio that is
// missing, squared or upside down in one of the five constants; leakage on the wrong side.
TEST(Transformer, TheModelHasTheTransferFunctionOfTheCircuit) {
  std::mt19937_64 engine(7);
  std::uniform_real_distribution<double> exponent(-3.0, 0.0);
  const auto some = [&] { return std::pow(10.0, exponent(engine)); };
  for (int n = 0; n < 200; ++n) {
    const TransformerParameters t = {.turns_ratio = 30.0 * some(),
                                     .primary_resistance_ohm = 10.0 * some(),
                                     .primary_leakage_h = some(),
                                     .magnetising_inductance_h = some(),
                                     .secondary_resistance_ohm = 10.0 * some(),
                                     .secondary_leakage_h = some()};
    const RigLoad load = {.resistance_ohm = 10.0 * some(), .inductance_h = some()};
    const Complex s(100.0 * some(), 1000.0 * some());
    EXPECT_NEAR(std::abs(current_of_model(t, load, s) / current_per_volt(t, load, s) - 1.0), 0.0, 1e-10);
  }
}

// Catches: an ideal transformer that is not one: leakage and resistance may all be zero.
TEST(Transformer, AnIdealOneOnlyScales) {
  const TransformerConstants c = constants_of({.turns_ratio = 0.4, .magnetising_inductance_h = 150e-3});
  EXPECT_EQ(c.gain, 0.4);
  EXPECT_EQ(c.decay_per_s, 0.0);
  EXPECT_EQ(c.coupling_ohm, 0.0);
  EXPECT_EQ(c.resistance_ohm, 0.0);
  EXPECT_EQ(c.inductance_h, 0.0);
  EXPECT_EQ(constants_of(TransformerParameters{}).gain, 0.0);
}

/// A source of 100 V and 50 Hz behind a transformer, with windings of this load. Those of the rig have the
/// impedance of the transformer in them, as the machines of an axis have.
struct TransformerRig {
  TransformerRig(const TransformerParameters& transformer, RigLoad secondary, Connection connection,
                 int substeps = 10)
      : t(transformer),
        load(secondary),
        rig(drive_of(transformer), connection,
            {.resistance_ohm =
                 secondary.resistance_ohm + series_impedance(drive_of(transformer)).resistance_ohm,
             .inductance_h = secondary.inductance_h + series_impedance(drive_of(transformer)).inductance_h},
            substeps) {}

  static DriveParameters drive_of(const TransformerParameters& transformer) {
    DriveParameters p = plain_drive(DriveKind::kSource);
    p.source.amplitude_v = 100.0;
    p.source.frequency_hz = 50.0;
    p.transformer = transformer;
    return p;
  }
  double flux_wb(std::size_t k) const { return rig.memory.transformer[k].flux_wb; }
  /// i_1 of the phase: λ = (L_l1 + L_m)·i_1 − L_m·n·i_2.
  double primary_a(std::size_t k) const {
    return (flux_wb(k) + t.magnetising_inductance_h * t.turns_ratio * rig.current_a[k]) /
           (t.primary_leakage_h + t.magnetising_inductance_h);
  }
  void run_ticks(int count) {
    for (int n = 0; n < count; ++n)
      rig.tick({});
  }

  TransformerParameters t;
  RigLoad load;
  DriveRig rig;
};

constexpr RigLoad kLoad = {.resistance_ohm = 6.0, .inductance_h = 12e-3};
constexpr int kPeriodTicks = 200;  // of 100 us

// The currents settle within 1 s, 20 time constants (L_l1 + L_m)/R_1. In a star without a neutral the phases
// keep their own transformers: the balanced currents are those of three single circuits, and phase k is k
// thirds of a turn behind. Catches: the flux of another phase, a voltage of the wrong instant, a state that
// does not act back.
TEST(Transformer, ALoadSettlesAtTheTransferFunction) {
  for (const Connection connection : {Connection::kArmature, Connection::kStar}) {
    TransformerRig x(kWeak, kLoad, connection);
    x.run_ticks(50 * kPeriodTicks);
    const Complex per_volt = current_per_volt(kWeak, kLoad, {0.0, kOmega_rad_s});
    for (int tick = 0; tick < kPeriodTicks; ++tick) {
      for (int k = 0; k < terminal_count(connection); ++k) {
        const double angle =
            kOmega_rad_s * static_cast<double>(x.rig.now) * kRigTick_s - k * 2.0 * std::numbers::pi / 3.0;
        const Complex phasor = 100.0 * per_volt * std::polar(1.0, angle);
        ASSERT_NEAR(x.rig.current_a[static_cast<std::size_t>(k)], phasor.real(), 1e-7 * std::abs(phasor));
      }
      x.rig.tick({});
    }
  }
}

// Over a period what the source gives is what the resistances take: R_1·i_1², R_2·i_2² and the load's. Sums
// over the ticks of a period are exact for a sine. Catches: a flux that the secondary current does not
// oppose, power that appears or is lost in the transformer.
TEST(Transformer, TheSourceGivesWhatTheResistancesTake) {
  TransformerRig x(kWeak, kLoad, Connection::kArmature);
  x.run_ticks(50 * kPeriodTicks);
  double given_j = 0.0;
  double taken_j = 0.0;
  for (int tick = 0; tick < kPeriodTicks; ++tick) {
    const double i_1 = x.primary_a(0);
    const double i_2 = x.rig.current_a[0];
    const double v_1 = 100.0 * std::cos(kOmega_rad_s * static_cast<double>(x.rig.now) * kRigTick_s);
    given_j += kRigTick_s * v_1 * i_1;
    taken_j += kRigTick_s * (kWeak.primary_resistance_ohm * i_1 * i_1 +
                             (kWeak.secondary_resistance_ohm + kLoad.resistance_ohm) * i_2 * i_2);
    x.rig.tick({});
  }
  EXPECT_GT(given_j, 1.0);
  EXPECT_NEAR(given_j, taken_j, 1e-7 * given_j);
}

// Steps of 100 us err by 5.8e-8 A; halved ones leave a sixth or less of the error: third order. Catches: a
// current that is held or continued by a line, a flux in the middle of the interval that is off.
TEST(Transformer, HalvedStepsLeaveASixthOfTheErrorOrLess) {
  const auto after_a_period = [](int substeps) {
    TransformerRig x(kWeak, kLoad, Connection::kArmature, substeps);
    x.run_ticks(kPeriodTicks);
    return Complex(x.rig.current_a[0], x.flux_wb(0));
  };
  const Complex exact = after_a_period(64);
  const Complex coarse = after_a_period(1) - exact;
  const Complex fine = after_a_period(2) - exact;
  EXPECT_LT(std::abs(coarse.real()), 6e-8);
  EXPECT_GT(std::abs(coarse.real()), 6.0 * std::abs(fine.real()));
  EXPECT_GT(std::abs(coarse.imag()), 6.0 * std::abs(fine.imag()));
}

// The primaries stay on the source: λ' = v_1 − a·λ from rest has the closed form A·cos(ωt − φ) − A·cos
// φ·e^(−at). Catches: a flux that stands still or forgets itself while the contactor is open.
TEST(Transformer, AnOpenContactorLeavesThePrimaryOnTheSource) {
  DriveParameters p = TransformerRig::drive_of(kWeak);
  p.source.contactor = false;
  DriveRig rig(p, Connection::kTwoPhase);
  constexpr int kTicks = 333;
  for (int tick = 0; tick < kTicks; ++tick)
    rig.tick({});
  EXPECT_EQ(rig.current_a[0], 0.0);
  const double decay =
      kWeak.primary_resistance_ohm / (kWeak.primary_leakage_h + kWeak.magnetising_inductance_h);
  const Complex settled = 100.0 / Complex(decay, kOmega_rad_s);
  const double time_s = kTicks * kRigTick_s;
  const double expected_wb =
      (settled * std::polar(1.0, kOmega_rad_s * time_s)).real() - settled.real() * std::exp(-decay * time_s);
  EXPECT_NEAR(rig.memory.transformer[0].flux_wb, expected_wb, 1e-10);
}

// Catches: a transformer that a source of 0 Hz passes over, one that stays at its first voltage.
TEST(Transformer, DirectVoltageComesThroughAsAPulse) {
  DriveParameters p = TransformerRig::drive_of(kWeak);
  p.source.frequency_hz = 0.0;
  DriveRig rig(p, Connection::kArmature, kLoad);
  const TerminalDrive first = [&] {
    rig.drive.begin_tick(rig.memory, {}, {}, 0);
    return rig.drive.at(rig.memory, 0.0, 1e-5, {});
  }();
  EXPECT_FALSE(first.constant);
  EXPECT_NEAR(first.start_v.a, 100.0 * constants_of(kWeak).gain, 1e-12);
  for (int tick = 0; tick < 20'000; ++tick)
    rig.tick({});
  EXPECT_NEAR(rig.current_a[0], 0.0, 1e-9);
}

// Catches: an arc that is weaker than the voltage of a transformer that steps up.
TEST(Transformer, TheArcOfTheContactorIsAboveTheSecondaryVoltage) {
  TransformerParameters up = kWeak;
  up.turns_ratio = 5.0;
  TransformerRig x(up, kLoad, Connection::kArmature);
  x.run_ticks(1);
  EXPECT_GE(x.rig.drive.at(x.rig.memory, 0.0, 1e-5, {}).rail_v, 1000.0);
}

/// A PM-DC machine of 1 ms behind a transformer on a source.
AxisParameters axis_behind(const TransformerParameters& transformer) {
  AxisParameters p;
  p.machine = PmDcMachineParameters{
      .armature_resistance_ohm = 1.0, .armature_inductance_h = 1e-3, .torque_constant_nm_per_a = 0.1};
  p.mechanics.inertia_kgm2 = 1e-3;
  p.drive = TransformerRig::drive_of(transformer);
  return p;
}

// Catches: substeps that do not see the resistance in series with the winding, or the flux of the
// transformer.
TEST(Transformer, SubstepsSeeTheFastestTimeConstant) {
  constexpr double kPeriod_s = 100e-6;
  TransformerParameters t = {.turns_ratio = 1.0, .magnetising_inductance_h = 0.5};
  EXPECT_EQ(default_substeps(axis_behind(t), kPeriod_s), 2);
  t.secondary_resistance_ohm = 9.0;  // 100 us with the winding's 1 ohm and 1 mH
  EXPECT_EQ(default_substeps(axis_behind(t), kPeriod_s), 10);
  t = {.turns_ratio = 0.01, .primary_resistance_ohm = 2500.0, .magnetising_inductance_h = 0.5};
  EXPECT_EQ(default_substeps(axis_behind(t), kPeriod_s), 7);  // 5000/s of the flux and 1250/s: 160 us
}

}  // namespace
}  // namespace drivebench::transformer_test
