// The bench dynamometer: the servo motor and a DC machine on one shaft, each with its commands.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "tests/book/book_bench.hpp"
#include "tests/book/machines/steady_induction.hpp"

namespace drivebench::dynamometer_test {
namespace {

constexpr double kLine_rad_s = 2.0 * std::numbers::pi * 60.0;
constexpr double kPeak_v = 60.0;
constexpr double kInertia_kgm2 = 1.7e-4;
constexpr double kFriction_nms = 5.4e-4;
constexpr double kLoadConstant = 0.07;  // of the DC machine
constexpr double kLoad_ohm = 2.0;
constexpr double kLoad_h = 2e-3;

/// One tick of the bench: 60 V, 60 Hz for the servo, this current for the load machine. The sine is that of
/// the middle of the tick.
void step(BookBench& run, double load_a) {
  const double phase = kLine_rad_s * (run.now_s() + 0.5 * run.period_s());
  run.command(0, {.gates = Gates::kVoltage,
                  .setpoint = {.a = kPeak_v * std::cos(phase), .b = kPeak_v * std::sin(phase)}});
  run.command(1, {.gates = Gates::kCurrent, .setpoint = {.a = load_a}});
  run.bench().step();
}

InductionMachineParameters servo_of(const BookBench& run) {
  return std::get<InductionMachineParameters>(run.config().setup.axes[0].parameters.machine);
}

/// The speed at which the servo's torque at 60 V balances friction and the torque of the load machine.
double balanced_rad_s(const InductionMachineParameters& servo, double load_nm) {
  const InductionMachineConstants c = constants_of(servo);
  double low = 80.0;  // both on the steep side of the torque curve
  double high = 150.0;
  for (int k = 0; k < 60; ++k) {
    const double w = 0.5 * (low + high);
    const double torque = kPeak_v * kPeak_v * per_volt(c, w, kLine_rad_s - 3.0 * w).torque_nm;
    (torque > kFriction_nms * w + load_nm ? low : high) = w;
  }
  return 0.5 * (low + high);
}

// As it is shipped, the load machine first idle, then braking, then driving: speed and torques are those
// where the circuit of the servo meets K_T i and friction; 1e-3, of which the held voltages take 2e-4. Both
// axes turn as one. Catches: a load machine whose torque has the wrong sign or does not reach the shaft, a
// torque that is counted twice, friction and inertia of one rotor only.
TEST(BookDynamometer, TheServoBalancesTheTorqueOfTheLoadMachine) {
  BookBench run("dynamometer");
  for (const double load_a : {0.0, -2.0, 4.0}) {
    const double end_s = run.now_s() + 1.0;
    while (run.now_s() < end_s)
      step(run, load_a);
    const Sample& motor = run.sample(0);
    const Sample& load = run.sample(1);
    const double expected_rad_s = balanced_rad_s(servo_of(run), -kLoadConstant * load_a);
    EXPECT_NEAR(motor.speed_rad_s, expected_rad_s, 1e-3 * expected_rad_s) << load_a;
    EXPECT_NEAR(load.true_i_a_a, load_a, 1e-3);
    EXPECT_NEAR(load.torque_nm, kLoadConstant * load.true_i_a_a, 1e-12);
    EXPECT_NEAR(motor.torque_nm + load.torque_nm, kFriction_nms * motor.speed_rad_s, 1e-3);
    EXPECT_EQ(load.speed_rad_s, motor.speed_rad_s);
    EXPECT_EQ(load.encoder_count, motor.encoder_count);
    EXPECT_EQ((motor.faults | load.faults) & kLatchedFaults, 0u);
  }
}

/// Sums over the power analysers of both axes and over the samples.
struct Audit {
  double supplied_j = 0.0;
  double copper_j = 0.0;  ///< of the stator and the armature
  double rotor_j = 0.0;
  double friction_j = 0.0;
};

double rotor_loss_w(const InductionMachineParameters& p, const Sample& s) {
  const double a = (s.psi_a_wb - p.mutual_inductance_h * s.true_i_a_a) / p.rotor_inductance_h;
  const double b = (s.psi_b_wb - p.mutual_inductance_h * s.true_i_b_a) / p.rotor_inductance_h;
  return p.rotor_resistance_ohm * (a * a + b * b);
}

double stored_j(const InductionMachineParameters& p, const Sample& motor, const Sample& load) {
  const InductionMachineState x{motor.true_i_a_a, motor.true_i_b_a, motor.psi_a_wb, motor.psi_b_wb};
  return stored_energy_j(constants_of(p), x, {}) + 0.5 * kLoad_h * load.true_i_a_a * load.true_i_a_a +
         0.5 * kInertia_kgm2 * motor.speed_rad_s * motor.speed_rad_s;
}

// The same bench with a power analyser on each axis, which reads the energy of every 50 ms exactly: from rest
// to a shaft that brakes and then drives, the energy of both drives is lost in the windings and in friction
// or is stored. 1e-4: the losses of rotor and friction are sums over samples 125 us apart. Catches: a shaft
// that loses energy between the two machines, a meter that ignores negative power.
TEST(BookDynamometer, TheEnergyOfBothDrivesIsLostOrStored) {
  BenchConfig config = load_config(std::string(DRIVEBENCH_CONFIGS) + "/benches/dynamometer.toml");
  for (AxisSetup& axis : config.setup.axes)
    axis.parameters.sensors.meter = {.enabled = true, .window_s = 0.05};
  BookBench run(config);
  const InductionMachineParameters servo = servo_of(run);
  Audit audit;
  double least_load_w = 0.0;
  constexpr int kTicksPerWindow = 400;
  for (int window = 0; window < 12; ++window) {
    for (int tick = 0; tick < kTicksPerWindow; ++tick) {
      const Sample from = run.sample();
      step(run, window < 4 ? 0.0 : window < 8 ? -2.0 : 4.0);
      const Sample& to = run.sample();
      audit.rotor_j += 0.5 * run.period_s() * (rotor_loss_w(servo, from) + rotor_loss_w(servo, to));
      audit.friction_j += 0.5 * run.period_s() * kFriction_nms *
                          (from.speed_rad_s * from.speed_rad_s + to.speed_rad_s * to.speed_rad_s);
    }
    const Sample& motor = run.sample(0);
    const Sample& load = run.sample(1);
    audit.supplied_j += 0.05 * (motor.meter_p_w + load.meter_p_w);
    audit.copper_j += 0.05 * (2.0 * servo.stator_resistance_ohm * motor.meter_i_rms_a * motor.meter_i_rms_a +
                              kLoad_ohm * load.meter_i_rms_a * load.meter_i_rms_a);
    least_load_w = std::min(least_load_w, load.meter_p_w);
  }
  EXPECT_LT(least_load_w, -5.0);  // the load machine has been a generator
  EXPECT_GT(audit.supplied_j, 50.0);
  EXPECT_NEAR(
      audit.supplied_j,
      audit.copper_j + audit.rotor_j + audit.friction_j + stored_j(servo, run.sample(0), run.sample(1)),
      1e-4 * audit.supplied_j);
}

}  // namespace
}  // namespace drivebench::dynamometer_test
