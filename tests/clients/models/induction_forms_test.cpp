#include "clients/models/induction_forms.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include "plant/axis.hpp"

namespace drivebench::induction_forms_test {
namespace {

/// The 208 V motor of the book's problem 7.18 (IM-B).
constexpr InductionWindings kMotor{.stator_resistance_ohm = 1.85,
                                   .rotor_resistance_ohm = 2.1,
                                   .stator_inductance_h = 0.244,
                                   .rotor_inductance_h = 0.244,
                                   .mutual_inductance_h = 0.225};
/// The same with fewer turns on the rotor, as it may be measured at the slip rings of a wound one.
constexpr InductionWindings kWound = kMotor.with_turns(0.6);

std::complex<double> impedance(const InductionWindings& w, double line_rad_s, double slip) {
  const std::complex<double> j(0.0, 1.0);
  const std::complex<double> m = j * line_rad_s * w.mutual_inductance_h;
  return w.stator_resistance_ohm + j * line_rad_s * w.stator_inductance_h -
         m * m / (w.rotor_resistance_ohm / slip + j * line_rad_s * w.rotor_inductance_h);
}

InductionWindings forms(int k) {
  if (k == 0) return kWound.with_turns(kWound.turns_of_gamma());
  if (k == 1) return kWound.with_turns(kWound.turns_of_inverse_gamma());
  return kWound.with_turns(kWound.turns_of_equal_leakages());
}

// The numbers of the reference (P3-15) to 5e-5, as it rounded on the way; the forms by their definitions, the
// impedance at the terminals to rounding. Catches: turns that scale M or R_R by another power, the leakage on
// the wrong side.
TEST(InductionForms, NoTerminalTellsThemApart) {
  const double sigma = kMotor.leakage();
  const InductionTCircuit gamma = t_circuit_of(forms(0));
  EXPECT_NEAR(gamma.stator_leakage_h, 0.0, 1e-16);
  EXPECT_NEAR(gamma.rotor_leakage_h, sigma * kMotor.stator_inductance_h / (1.0 - sigma), 1e-15);
  EXPECT_NEAR(gamma.rotor_leakage_h, 0.042948, 5e-5 * 0.042948);
  EXPECT_NEAR(gamma.rotor_resistance_ohm, 2.4697, 5e-5 * 2.4697);
  const InductionTCircuit inverse = t_circuit_of(forms(1));
  EXPECT_NEAR(inverse.stator_leakage_h, 0.036520, 5e-5 * 0.036520);
  EXPECT_NEAR(inverse.magnetizing_h, 0.207480, 5e-5 * 0.207480);
  EXPECT_NEAR(inverse.rotor_resistance_ohm, 1.78567, 5e-5 * 1.78567);
  EXPECT_NEAR(inverse.rotor_leakage_h, 0.0, 1e-16);
  EXPECT_NEAR(inverse.stator_leakage_h, sigma * kMotor.stator_inductance_h, 1e-15);
  const InductionTCircuit equal = t_circuit_of(forms(2));
  EXPECT_NEAR(equal.stator_leakage_h, 0.019, 1e-15);
  EXPECT_NEAR(equal.rotor_leakage_h, 0.019, 1e-15);
  for (int k = 0; k < 3; ++k) {
    for (const double slip : {-0.2, 0.02, 0.3, 1.0, 2.0}) {
      const std::complex<double> expected = impedance(kMotor, 377.0, slip);
      EXPECT_LT(std::abs(impedance(forms(k), 377.0, slip) / expected - 1.0), 1e-13);
    }
    EXPECT_NEAR(forms(k).leakage(), sigma, 1e-14);
    EXPECT_NEAR(forms(k).rotor_time_s(), kMotor.rotor_time_s(), 1e-15);
  }
  const InductionWindings back = windings_of(t_circuit_of(kMotor));
  EXPECT_NEAR(back.stator_inductance_h, kMotor.stator_inductance_h, 1e-16);
  EXPECT_NEAR(back.rotor_inductance_h, kMotor.rotor_inductance_h, 1e-16);
}

AxisParameters axis_of(const InductionWindings& w) {
  AxisParameters p;
  p.machine = InductionMachineParameters{.pole_pairs = 3,
                                         .stator_resistance_ohm = w.stator_resistance_ohm,
                                         .rotor_resistance_ohm = w.rotor_resistance_ohm,
                                         .stator_inductance_h = w.stator_inductance_h,
                                         .rotor_inductance_h = w.rotor_inductance_h,
                                         .mutual_inductance_h = w.mutual_inductance_h};
  p.mechanics = {.inertia_kgm2 = 0.01, .viscous_friction_nms = 1e-3};
  p.drive.amplifier = {.voltage_limit_v = 1000.0, .over_current_a = 1000.0};
  return p;
}

// P3-15 on the bench's machine: a start from standstill has the same currents and the same speed in every
// form, to 1e-9 of their size. Catches: a form that is right in steady state only.
TEST(InductionForms, AMotorStartsAlikeInEveryForm) {
  constexpr double kTick_s = 125e-6;
  constexpr AxisTiming kTiming{.period_s = kTick_s, .substeps = 5};
  for (int k = 0; k < 3; ++k) {
    Axis first(axis_of(kMotor), kTiming, 1, 0);
    Axis other(axis_of(forms(k)), kTiming, 1, 0);
    double most_a = 0.0;
    double difference_a = 0.0;
    for (Tick tick = 0; tick < 2000; ++tick) {
      const double angle = 2.0 * std::numbers::pi * 60.0 * kTick_s * static_cast<double>(tick);
      const PhaseCommand command{.gates = Gates::kVoltage,
                                 .setpoint = {200.0 * std::cos(angle), 200.0 * std::sin(angle)}};
      first.advance(command, tick);
      other.advance(command, tick);
      most_a = std::max(most_a, std::abs(first.sample(tick + 1).true_i_a_a));
      difference_a = std::max(
          difference_a, std::abs(first.sample(tick + 1).true_i_a_a - other.sample(tick + 1).true_i_a_a));
    }
    EXPECT_GT(first.state().shaft.speed_rad_s, 10.0);
    EXPECT_LT(difference_a, 1e-9 * most_a);
    EXPECT_NEAR(other.state().shaft.speed_rad_s, first.state().shaft.speed_rad_s, 1e-9 * 125.0);
  }
}

}  // namespace
}  // namespace drivebench::induction_forms_test
