#include "clients/identification/motors/motors.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <set>
#include <string>

#include "clients/identification/named_experiments.hpp"

namespace drivebench::identification::motors_test {
namespace {

const BenchParameters kInduction = {{"machine.pole_pairs", 2},
                                    {"machine.stator_resistance_ohm", 9.7},
                                    {"machine.rotor_resistance_ohm", 8.6},
                                    {"machine.stator_inductance_h", 0.67},
                                    {"machine.rotor_inductance_h", 0.67},
                                    {"machine.mutual_inductance_h", 0.64},
                                    {"mechanics.inertia_kgm2", 0.011},
                                    {"encoder.counts_per_revolution", 2048}};

// The numbers of 8.5.5, five digits. Catches: T_R upside down, sigma for 1 - sigma, K_16 without the pole
// pairs.
TEST(Motors, TheTruthOfAnInductionMotorIsThatOfTheBook) {
  const auto truth = truth_of(MotorKind::kInduction, kInduction);
  const auto expect = [&](const char* name, double value) {
    ASSERT_TRUE(truth.contains(name)) << name;
    EXPECT_NEAR(truth.find(name)->second, value, 5e-5 * value) << name;
  };
  expect("R_S", 9.7);
  expect("T_R", 0.077907);
  expect("L_S", 0.67);
  expect("sigma", 0.0875473);
  expect("M", 0.64);
  expect("R_R", 8.6);
  expect("K4", 1717.2);
  expect("K6", 3839.8);
  expect("K14", 218.83);
  expect("J", 0.011);
  expect("K16", 181.82);
}

// Catches: a saliency of the wrong sign or twice as large, an L_S of a motor that has none, an L_g of a round
// one.
TEST(Motors, TheTruthOfAPmMotorIsThatOfItsRotor) {
  BenchParameters bench = {{"machine.pole_pairs", 4},
                           {"machine.stator_resistance_ohm", 0.35},
                           {"machine.inductance_d_h", 1.8e-3},
                           {"machine.inductance_q_h", 4.2e-3},
                           {"machine.torque_constant_nm_per_a", 0.3}};
  auto truth = truth_of(MotorKind::kPmSynchronous, bench);
  EXPECT_EQ(truth.find("L_d")->second, 1.8e-3);
  EXPECT_EQ(truth.find("L_q")->second, 4.2e-3);
  EXPECT_DOUBLE_EQ(truth.find("L_g")->second, -1.2e-3);
  EXPECT_FALSE(truth.contains("L_S"));
  bench["machine.inductance_q_h"] = 1.8e-3;
  truth = truth_of(MotorKind::kPmSynchronous, bench);
  EXPECT_EQ(truth.find("L_S")->second, 1.8e-3);
  EXPECT_FALSE(truth.contains("L_d") || truth.contains("L_g"));
}

// A motor whose leakages differ: its terminals are those of one with equal leakages. Catches: the bench's own
// M and R_R as the truth about a split that no data show.
TEST(Motors, UnequalLeakagesAreComparedAsEqualOnes) {
  BenchParameters bench = kInduction;
  bench["machine.rotor_inductance_h"] = 2.0 * 0.67;
  bench["machine.rotor_resistance_ohm"] = 2.0 * 8.6;
  bench["machine.mutual_inductance_h"] = std::sqrt(2.0) * 0.64;
  const auto truth = truth_of(MotorKind::kInduction, bench);
  EXPECT_NEAR(truth.find("M")->second, 0.64, 1e-9);
  EXPECT_NEAR(truth.find("R_R")->second, 8.6, 1e-9);
}

// Catches: a truth where the method has another meaning or the number is unknown.
TEST(Motors, AParameterWithoutOneMeaningHasNoTruth) {
  BenchParameters bench = kInduction;
  bench["thermal.enabled"] = 1.0;
  EXPECT_FALSE(truth_of(MotorKind::kInduction, bench).contains("R_S"));
  EXPECT_TRUE(truth_of(MotorKind::kInduction, bench).contains("L_S"));
  bench = kInduction;
  bench["mechanics.load_inertia_kgm2"] = 0.1;
  EXPECT_FALSE(truth_of(MotorKind::kInduction, bench).contains("J"));
  bench.erase("machine.rotor_resistance_ohm");
  EXPECT_TRUE(truth_of(MotorKind::kInduction, bench).empty());
  EXPECT_TRUE(truth_of(MotorKind::kDc, kInduction).empty());
  const BenchParameters salient = {{"machine.stator_resistance_ohm", 0.6},
                                   {"machine.inductance_d_h", 2e-3},
                                   {"machine.inductance_q_h", 3e-3},
                                   {"machine.torque_constant_nm_per_a", 0.5}};
  EXPECT_FALSE(truth_of(MotorKind::kPmSynchronous, salient).contains("L_S"));
  EXPECT_TRUE(truth_of(MotorKind::kPmSynchronous, salient).contains("K_m"));
}

double shift_of(std::string_view drive, int substeps, int decimation, BenchParameters bench = {}) {
  MeasurementFacts facts;
  facts.decimation = decimation;
  take_facts(bench, drive, substeps, facts);
  return settings_of(MotorKind::kInduction, facts, 1e-4).processing.voltage_shift;
}

// Half of the time that a voltage held before its sample, in periods of the data. Catches: a shift that
// forgets decimation, or that follows the motor's kind in the place of the drive's.
TEST(Motors, TheVoltageShiftFollowsTheDrive) {
  EXPECT_DOUBLE_EQ(shift_of("source", 5, 1), 0.0);
  EXPECT_DOUBLE_EQ(shift_of("voltage_amplifier", 5, 1), 0.5);
  EXPECT_DOUBLE_EQ(shift_of("voltage_amplifier", 5, 10), 0.05);
  EXPECT_DOUBLE_EQ(shift_of("current_amplifier", 5, 1), 0.1);
  EXPECT_DOUBLE_EQ(shift_of("current_amplifier", 1, 100), 0.005);
  EXPECT_DOUBLE_EQ(shift_of("voltage_amplifier", 1, 1, {{"amplifier.filter_hz", 1e4}}), 0.0);
}

// Catches: a warning that is not given where the voltages cannot be what the method takes them for, or that
// stays.
TEST(Motors, UnsuitableVoltagesGiveANote) {
  MeasurementFacts facts;
  take_facts({}, "current_amplifier", 5, facts);
  EXPECT_FALSE(facts.note.empty());
  take_facts({}, "voltage_amplifier", 5, facts);
  EXPECT_TRUE(facts.note.empty());
  take_facts({{"amplifier.delay_ticks", 1.6}}, "voltage_amplifier", 5, facts);
  EXPECT_FALSE(facts.note.empty());
  take_facts({{"amplifier.delay_ticks", 1.0}, {"encoder.half_count_offset", 1.0}}, "voltage_amplifier", 5,
             facts);
  EXPECT_TRUE(facts.note.empty());
  EXPECT_FALSE(facts.half_count);
  take_facts({}, "switched_inverter", 5, facts);
  EXPECT_FALSE(facts.note.empty());
}

// tau_L is what the load was, if it was one number. Catches: a truth for a load that changes within the
// window.
TEST(Motors, TheLoadIsATruthIfItIsConstant) {
  Settings e = settings_of(MotorKind::kInduction, {}, 1e-3);
  e.load = LoadModel::kConstant;
  MeasuredData data{.period_s = 1e-3, .columns = {{"load_nm", "N*m", Series(200, 3.7)}}};
  auto truth = truth_of(MotorKind::kInduction, kInduction);
  add_load_truth(data, e, truth);
  EXPECT_DOUBLE_EQ(truth.find("tau_L")->second, 3.7);
  EXPECT_NEAR(truth.find("K17")->second, 3.7 / 0.011, 1e-9);
  data.columns[0].values[100] = 3.8;
  truth = truth_of(MotorKind::kInduction, kInduction);
  add_load_truth(data, e, truth);
  EXPECT_FALSE(truth.contains("tau_L"));
}

// Catches: a named experiment without its file or bench, a motor without any, one name twice.
TEST(Motors, EveryNamedExperimentHasItsFiles) {
  const std::filesystem::path configs = DRIVEBENCH_CONFIGS;
  std::set<std::string> names;
  std::set<std::string_view> motors;
  for (const NamedExperiment& each : named_experiments()) {
    ASSERT_NE(find_motor(each.motor), nullptr) << each.motor;
    EXPECT_TRUE(names.insert(std::string(each.motor) + "/" + std::string(each.name)).second) << each.name;
    EXPECT_TRUE(std::filesystem::exists(configs / "experiments" / (std::string(each.file) + ".toml")))
        << each.file;
    EXPECT_TRUE(std::filesystem::exists(configs / "benches" / (std::string(each.bench) + ".toml")))
        << each.bench;
    EXPECT_EQ(find_experiment(each.motor, each.name), &each);
    motors.insert(each.motor);
  }
  EXPECT_EQ(motors.size(), kMotorNames.size());
  EXPECT_EQ(find_motor("ac"), nullptr);
  EXPECT_EQ(find_experiment("dc", "dol-start"), nullptr);
  EXPECT_EQ(experiment_names("im"),
            "dol-start, no-load-start, dc-resistance, no-load, blocked-rotor, classical");
  EXPECT_EQ(experiment_of(TerminalTest::kBlockedRotor).name, "blocked-rotor");
  EXPECT_EQ(motor_name(MotorKind::kBldc).name, "bldc");
}

// Catches: settings of a named experiment that are not applied, or that take filters away.
TEST(Motors, ANamedExperimentSetsWindowLoadAndFilters) {
  Settings e = settings_of(MotorKind::kPmSynchronous, {}, 2e-5);
  apply(*find_experiment("pm", "ramp"), e);
  EXPECT_DOUBLE_EQ(e.processing.shaft.cutoff_hz, 200.0);
  EXPECT_DOUBLE_EQ(e.processing.from_s, 0.005);
  e = settings_of(MotorKind::kInduction, {}, 2.5e-4);
  apply(*find_experiment("im", "dol-start"), e);
  EXPECT_EQ(e.load, LoadModel::kConstant);
  EXPECT_DOUBLE_EQ(e.processing.current.cutoff_hz, 200.0);
}

}  // namespace
}  // namespace drivebench::identification::motors_test
