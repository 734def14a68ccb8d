#include "plant/machines/pm_dc/pm_dc_machine.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <random>

#include "tests/plant/dc_rig.hpp"

namespace drivebench::dc_machine_test {
namespace {

/// Motor DC-A of the reference: the book, chapter 1, problem 8.
constexpr PmDcMachineParameters kDcA{
    .armature_resistance_ohm = 2.0, .armature_inductance_h = 2e-3, .torque_constant_nm_per_a = 0.07};
constexpr ShaftLoad kDcALoad{.inertia_kgm2 = 6e-5, .friction_nms = 4e-4};
constexpr double kStep_s = 50e-6;

using DcRig = Rig<PmDcMachineState>;

// Catches: any wrong sign or factor, K_b taken for something else than K_T.
TEST(PmDcMachine, InputPowerIsStoredLostOrDeliveredInRandomStates) {
  std::mt19937_64 engine(21);
  const auto draw = [&engine](double size) {
    return std::uniform_real_distribution<double>(-size, size)(engine);
  };
  const PmDcMachineConstants c = constants_of(kDcA);
  for (int n = 0; n < 10'000; ++n) {
    const RotorMotion motion = motion_of({.speed_rad_s = draw(500.0), .angle_rad = draw(6.0)});
    ASSERT_LT(unbalanced(c, PmDcMachineState{draw(20.0)}, motion, voltage(draw(40.0))), 1e-9)
        << "state " << n;
  }
}

// Conventions. Catches: a pair of wrong signs that leaves the balance intact.
TEST(PmDcMachine, PositiveVoltageDrivesPositiveCurrentAndThatPositiveTorque) {
  const PmDcMachineConstants c = constants_of(kDcA);
  EXPECT_NEAR(derivative(c, PmDcMachineState{}, motion_of({}), voltage(10.0)).i_a_a, 10.0 / 2e-3, 1e-9);
  EXPECT_NEAR(torque_nm(c, {.i_a_a = 2.0}, motion_of({})), 0.14, 1e-15);
  EXPECT_NEAR(open_circuit_voltages(c, {}, motion_of({.speed_rad_s = 100.0})).stator.a, 7.0, 1e-12);
}

struct StepRow {
  double time_s;
  double current_a;
  double speed_rad_s;
  double angle_rad;
  int count;
};

// AC-01: the table of DC-A. Catches: an exchanged or squared constant that conserves energy. Tolerance of the
// reference: 1e-4 relative, one count; plus half of the last digit that the table prints.
TEST(PmDcMachine, TenVoltStepOfMotorDcAIsTheTableOfTheReference) {
  constexpr auto kTable = std::to_array<StepRow>({
      {0.001, 3.13952, 2.13408, 0.000768, 0},
      {0.002, 4.21411, 6.51312, 0.004991, 1},
      {0.005, 4.37784, 21.80402, 0.047477, 15},
      {0.010, 3.60524, 43.95782, 0.214093, 68},
      {0.020, 2.46952, 74.80620, 0.820618, 261},
      {0.050, 1.10057, 111.97785, 3.755891, 1195},
      {0.100, 0.73510, 121.90162, 9.696297, 3086},
      {0.500, 0.70175, 122.80702, 58.800862, 18716},
  });
  const PmDcMachineConstants c = constants_of(kDcA);
  DcRig rig;
  double time_s = 0.0;
  for (const StepRow& row : kTable) {
    run(rig, row.time_s - time_s, kStep_s, c, voltage(10.0), kDcALoad);
    time_s = row.time_s;
    EXPECT_NEAR(rig.machine.i_a_a, row.current_a, 1e-4 * row.current_a + 5e-6) << time_s;
    EXPECT_NEAR(rig.shaft.speed_rad_s, row.speed_rad_s, 1e-4 * row.speed_rad_s + 5e-6) << time_s;
    EXPECT_NEAR(rig.shaft.angle_rad, row.angle_rad, 1e-4 * row.angle_rad + 5e-7) << time_s;
    EXPECT_NEAR(std::floor(rig.shaft.angle_rad * 2000.0 / (2.0 * std::numbers::pi)), row.count, 1.0)
        << time_s;
  }
}

/// The first instant at which condition(rig) holds along the 10 V step, and the rig then; by halving a step.
template <class Condition>
double first_time_s(DcRig& rig, const Condition& condition) {
  const PmDcMachineConstants c = constants_of(kDcA);
  rig = {};
  double time_s = 0.0;
  double h = kStep_s;
  while (h > 1e-10) {
    DcRig next = rig;
    step(next, h, c, voltage(10.0), kDcALoad);
    if (condition(next)) {
      h *= 0.5;
    } else {
      rig = next;
      time_s += h;
    }
  }
  return time_s;
}

// AC-01: the figures beside the table. Tolerances: their last printed digit.
TEST(PmDcMachine, TenVoltStepOfMotorDcAPeaksAndRisesWhenTheReferenceSays) {
  const PmDcMachineConstants c = constants_of(kDcA);
  DcRig rig;
  const double peak_s = first_time_s(rig, [&c](const DcRig& x) {
    return derivative(c, x.machine, motion_of(x.shaft), voltage(10.0)).i_a_a < 0.0;
  });
  EXPECT_NEAR(peak_s, 3.4124e-3, 1e-7);
  EXPECT_NEAR(rig.machine.i_a_a, 4.51983, 1e-5);
  const double final_rad_s = 0.07 * 10.0 / (2.0 * 4e-4 + 0.07 * 0.07);
  EXPECT_NEAR(final_rad_s, 122.80702, 1e-5);
  const auto reaches = [final_rad_s](double part) {
    return [=](const DcRig& x) { return x.shaft.speed_rad_s > part * final_rad_s; };
  };
  EXPECT_NEAR(first_time_s(rig, reaches(1.0 - 1.0 / std::numbers::e)), 21.221e-3, 1e-6);
  EXPECT_NEAR(first_time_s(rig, reaches(0.95)), 61.431e-3, 1e-6);
}

// AC-02. Catches: losses, torque or stored energy that belong to another equation. Along the transient the
// audit closes to what RK4 at 50 us leaves, 4e-9 J.
TEST(PmDcMachine, EnergyOfTheTenVoltStepIsLostOrStoredAllTheTime) {
  const PmDcMachineConstants c = constants_of(kDcA);
  DcRig rig;
  for (int ms = 0; ms < 500; ++ms) {
    run(rig, 1e-3, kStep_s, c, voltage(10.0), kDcALoad);
    ASSERT_NEAR(unaccounted_j(rig, c, kDcALoad), 0.0, 1e-8) << ms;
  }
  EXPECT_NEAR(rig.energy.drawn_j, 4.4127, 1e-3 * 4.4127);
  EXPECT_NEAR(stored_energy_j(c, rig.machine, motion_of(rig.shaft)), 0.5 * 2e-3 * 0.701754 * 0.701754, 1e-8);
}

// Catches: an open armature that drifts, a restriction that leaves current, an emf of the wrong sign.
TEST(PmDcMachine, AnOpenArmatureCarriesNothingAndItsEmfKeepsTheCurrentAtZero) {
  const PmDcMachineConstants c = constants_of(kDcA);
  const RotorMotion motion = motion_of({.speed_rad_s = -300.0});
  EXPECT_EQ(derivative(c, PmDcMachineState{}, motion, open_terminals()).i_a_a, 0.0);
  EXPECT_EQ(restricted(c, {.i_a_a = 3.0}, motion, open_terminals()).i_a_a, 0.0);
  EXPECT_EQ(restricted(c, {.i_a_a = 3.0}, motion, voltage(1.0)).i_a_a, 3.0);
  const double emf_v = open_circuit_voltages(c, {}, motion).stator.a;
  EXPECT_EQ(derivative(c, PmDcMachineState{}, motion, voltage(emf_v)).i_a_a, 0.0);
}

// Catches: an adjustment that goes to the wrong parameter.
TEST(PmDcMachine, AdjustmentsChangeResistanceInductanceAndMagnet) {
  const PmDcMachineParameters p = adjusted(kDcA, {.stator_resistance_factor = 1.5,
                                                  .rotor_resistance_factor = 7.0,
                                                  .magnet_factor = 0.8,
                                                  .series_resistance_ohm = 0.25,
                                                  .series_inductance_h = 1e-3});
  EXPECT_DOUBLE_EQ(p.armature_resistance_ohm, 3.25);
  EXPECT_DOUBLE_EQ(p.armature_inductance_h, 3e-3);
  EXPECT_DOUBLE_EQ(p.torque_constant_nm_per_a, 0.056);
  EXPECT_DOUBLE_EQ(fastest_time_constant_s(p), 3e-3 / 3.25);
  EXPECT_DOUBLE_EQ(rotor_flux_wb(constants_of(p), {}, motion_of({})).a, 0.056);
  EXPECT_EQ(connection_of(p), Connection::kArmature);
  EXPECT_EQ(pole_pairs_of(p), 0.0);
}

}  // namespace
}  // namespace drivebench::dc_machine_test
