// Every kind of machine along a transient: the energy that goes in is stored, lost, or kinetic.
#include "tests/plant/power_balance.hpp"

#include <gtest/gtest.h>

#include "plant/parameters/machine_kind.hpp"
#include "tests/plant/bldc_motor.hpp"
#include "tests/plant/dc_rig.hpp"
#include "tests/plant/induction_motors.hpp"

namespace drivebench::power_balance_test {
namespace {

/// The source that a machine is connected to while it starts from rest, and the load that it turns.
struct Start {
  double peak_v;
  double rate_rad_s = 0.0;  ///< of the vector of the voltages; 0: DC
  double field_v = 0.0;
  double inertia_kgm2;
  double step_s;
  int steps;
  double tolerance;  ///< of the energy that the windings have exchanged
};

/// Runs the start with the voltages held over each step, which machine and audit see alike.
template <class Machine>
void expect_energy_kept(const typename Machine::Parameters& p, const Start& start) {
  SCOPED_TRACE(Machine::kind().name);
  const auto c = constants_of(p);
  const ShaftLoad load{.inertia_kgm2 = start.inertia_kgm2};
  Rig<typename Machine::State> rig;
  double exchanged_j = 0.0;
  double top_rad_s = 0.0;
  for (int n = 0; n < start.steps; ++n) {
    const CosSin turned = cos_sin(start.rate_rad_s * n * start.step_s);
    const TerminalInput u{.voltage_v = {start.peak_v * turned.cos, start.peak_v * turned.sin},
                          .field_v = start.field_v};
    step(rig, start.step_s, c, u, load);
    const RotorMotion motion = motion_at(c, rig.shaft.angle_rad, rig.shaft.speed_rad_s);
    exchanged_j += start.step_s * exchanged_w(c, rig.machine, motion, u);
    top_rad_s = std::max(top_rad_s, std::abs(rig.shaft.speed_rad_s));
  }
  EXPECT_GT(top_rad_s, 1.0);
  EXPECT_NEAR(unaccounted_j(rig, c, load), 0.0, start.tolerance * exchanged_j);
}

// Catches: an energy that balances at an instant but not over the time in which the rotor turns; a torque or
// a loss of another equation. The steps are so short that their error is below the tolerance.
TEST(PowerBalance, EveryMachineKeepsItsEnergyAlongAStart) {
  expect_energy_kept<InductionMachine>(induction_motors::kMotorA,
                                       {.peak_v = 60.0,
                                        .rate_rad_s = induction_motors::kLine_rad_s,
                                        .inertia_kgm2 = 1.1e-4,
                                        .step_s = 10e-6,
                                        .steps = 20'000,
                                        .tolerance = 1e-9});
  expect_energy_kept<PmMachine>({.pole_pairs = 3,
                                 .stator_resistance_ohm = 0.4,
                                 .inductance_d_h = 1.1e-3,
                                 .inductance_q_h = 2.9e-3,
                                 .torque_constant_nm_per_a = 0.3,
                                 .detent_torque_nm = 0.2},
                                {.peak_v = 8.0,
                                 .rate_rad_s = 60.0,
                                 .inertia_kgm2 = 2e-3,
                                 .step_s = 10e-6,
                                 .steps = 20'000,
                                 .tolerance = 1e-9});
  expect_energy_kept<WoundRotorMachine>({.pole_pairs = 2,
                                         .stator_resistance_ohm = 0.7,
                                         .field_resistance_ohm = 5.0,
                                         .stator_inductance_h = 0.02,
                                         .field_inductance_h = 0.9,
                                         .mutual_inductance_h = 0.12},
                                        {.peak_v = 20.0,
                                         .rate_rad_s = 60.0,
                                         .field_v = 15.0,
                                         .inertia_kgm2 = 2e-3,
                                         .step_s = 10e-6,
                                         .steps = 20'000,
                                         .tolerance = 1e-9});
  expect_energy_kept<PmDcMachine>(
      {.armature_resistance_ohm = 2.0, .armature_inductance_h = 2e-3, .torque_constant_nm_per_a = 0.07},
      {.peak_v = 10.0, .inertia_kgm2 = 6e-5, .step_s = 10e-6, .steps = 20'000, .tolerance = 1e-9});
  expect_energy_kept<LinearDcMachine>(
      {.resistance_ohm = 0.5, .inductance_h = 1e-3, .flux_density_t = 1.0, .bar_length_m = 0.5},
      {.peak_v = 10.0, .inertia_kgm2 = 1.0, .step_s = 10e-6, .steps = 20'000, .tolerance = 1e-9});
  expect_energy_kept<SeparateDcMachine>({.armature_resistance_ohm = 0.5,
                                         .armature_inductance_h = 5e-3,
                                         .motor_constant = 0.03,
                                         .field_resistance_ohm = 100.0,
                                         .field_inductance_h = 20.0},
                                        {.peak_v = 240.0,
                                         .field_v = 240.0,
                                         .inertia_kgm2 = 0.2,
                                         .step_s = 50e-6,
                                         .steps = 20'000,
                                         .tolerance = 1e-9});
  expect_energy_kept<SeriesDcMachine>(
      {.armature_resistance_ohm = 0.3,
       .armature_inductance_h = 2e-3,
       .motor_constant = 0.5,
       .field_resistance_ohm = 0.2,
       .field_inductance_h = 0.05},
      {.peak_v = 240.0, .inertia_kgm2 = 0.5, .step_s = 50e-6, .steps = 20'000, .tolerance = 1e-9});
}

// The same where a curve or a trapezoid has kinks, at which Runge-Kutta steps lose their order. Catches: an
// energy that jumps at a point of the curve, an emf whose corners are not those of the torque.
TEST(PowerBalance, MachinesWithKinksKeepTheirEnergyToo) {
  expect_energy_kept<SaturatedInductionMachine>(
      {.pole_pairs = 3,
       .stator_resistance_ohm = 1.7,
       .rotor_resistance_ohm = 3.9,
       .stator_leakage_h = 0.0023,
       .rotor_leakage_h = 0.0029,
       .magnetising_curve = Curve({{0.0, 0.0}, {3.0, 0.0351}, {6.0, 0.055}, {12.0, 0.075}, {30.0, 0.1}})},
      {.peak_v = 60.0,
       .rate_rad_s = 377.0,
       .inertia_kgm2 = 1.1e-4,
       .step_s = 5e-6,
       .steps = 20'000,
       .tolerance = 1e-8});
  expect_energy_kept<BldcMachine>(bldc_motor::kMotor, {.peak_v = -40.0,
                                                       .rate_rad_s = 62.83,
                                                       .inertia_kgm2 = 2e-4,
                                                       .step_s = 5e-6,
                                                       .steps = 60'000,
                                                       .tolerance = 1e-10});
  expect_energy_kept<ShuntDcMachine>(
      {.armature_resistance_ohm = 0.5,
       .armature_inductance_h = 5e-3,
       .motor_constant = 0.03,
       .field_resistance_ohm = 80.0,
       .adjusting_resistance_ohm = 20.0,
       .saturation_curve = wound_saturation()},
      {.peak_v = 240.0, .inertia_kgm2 = 0.2, .step_s = 50e-6, .steps = 20'000, .tolerance = 1e-10});
}

}  // namespace
}  // namespace drivebench::power_balance_test
