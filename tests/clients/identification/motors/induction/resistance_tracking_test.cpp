#include "clients/identification/motors/induction/resistance_tracking.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "tests/clients/identification/bench_data.hpp"
#include "tests/repetitions.hpp"

namespace drivebench::identification::resistance_tracking_test {
namespace {

constexpr KnownInductances kKnown = {.stator_inductance_h = 0.67,
                                     .leakage_factor = 1.0 - 0.64 * 0.64 / (0.67 * 0.67)};

BenchConfig loaded(double load_nm, double stator_factor, double rotor_factor) {
  BenchConfig config = bench_config("im-8-5-5");
  auto& machine = std::get<InductionMachineParameters>(config.setup.axes[0].parameters.machine);
  machine.stator_resistance_ohm *= stator_factor;
  machine.rotor_resistance_ohm *= rotor_factor;
  config.setup.axes[0].parameters.encoder.counts_per_revolution = 4096;
  config.axes[0].events = {{.tick = 0, .action = LoadChange{.load_nm = load_nm, .ramp_ticks = 0}}};
  return config;
}

Settings steady_experiment(bool ideal) {
  Settings e{.kind = MotorKind::kInduction, .pole_pairs = 2};
  e.processing.voltage_shift = 0.0;
  if (ideal) return e;
  e.counts_per_revolution = 4096;
  e.processing.current = e.processing.voltage = e.processing.shaft = {.order = 3, .cutoff_hz = 100.0};
  return e;
}

/// 0.2 s of steady state at 4 kHz.
ResistanceEstimate steady_state(double load_nm, double stator_factor, double rotor_factor, bool ideal) {
  BookBench run(loaded(load_nm, stator_factor, rotor_factor));
  run.run_until(1.5);
  Recorder record = line_recorder(run.period_s(), ideal);
  run.run_until(1.75, std::ref(record));
  const auto instants = induction_instants(record.data(), steady_experiment(ideal));
  return identify_resistances(std::span(instants).subspan(100, 800), 2.0, kKnown);
}

// Case 24: 4096 counts, 12 bit, 100 Hz; 1 % of the reference's numbers, which lie within 0.6 % of the truth.
// The linear three-parameter fit is singular here. Catches: a resultant of another degree, the root at 1/T_R
// < 0.
TEST(Resistances, AreFoundInSteadyState) {
  const ResistanceEstimate nominal = steady_state(3.7, 1.0, 1.0, false);
  EXPECT_NEAR(nominal.stator_resistance_ohm, 9.648, 0.0965);
  EXPECT_NEAR(nominal.rotor_time_constant_s, 0.07790, 0.00078);
  EXPECT_EQ(nominal.degree, 5);
  EXPECT_TRUE(nominal.excitation.sufficient);
  EXPECT_LT(std::abs(nominal.stator_resistance_ohm - 9.7), nominal.stator_index_ohm);
  const ResistanceEstimate warm = steady_state(3.7, 1.2, 1.5, false);
  EXPECT_NEAR(warm.stator_resistance_ohm, 11.64, 0.1164);
  EXPECT_NEAR(warm.rotor_time_constant_s, 0.05194, 0.00052);
}

// Without errors of measurement the answer is the truth to 1e-5, down to a seventh of the load: nothing else
// is in the equations. Catches: a term of the equations that sensors would hide.
TEST(Resistances, AreExactWithoutErrorsOfMeasurement) {
  for (const double load_nm : {3.7, 0.5}) {
    const ResistanceEstimate found = steady_state(load_nm, 1.0, 1.0, true);
    EXPECT_NEAR(found.stator_resistance_ohm, 9.7, 1e-4);
    EXPECT_NEAR(found.rotor_time_constant_s, 0.67 / 8.6, 1e-6);
  }
}

// Case 24, negative: without load T_R is named as unseen, with and without sensors. Catches: a time constant
// of 700 s that is passed on.
TEST(Resistances, WithoutLoadTheRotorIsNotIdentifiable) {
  for (const bool ideal : {true, false}) {
    const Excitation excitation = steady_state(0.0, 1.0, 1.0, ideal).excitation;
    EXPECT_FALSE(excitation.sufficient);
    ASSERT_FALSE(excitation.unseen.empty());
    EXPECT_EQ(excitation.unseen.back(), "T_R");
    if (ideal) {
      EXPECT_NE(excitation.verdict.find("no slip"), std::string::npos) << excitation.verdict;
    }
  }
}

// On line: the rotor warms by 20 % over 2 s of bench time and the tracker follows, no estimate further than 3
// % from the truth in the middle of its window. Catches: a window that keeps old samples, a shaft or a phase
// in the wrong column.
TEST(Resistances, AreTrackedWhileTheyDrift) {
  BenchConfig config = loaded(3.7, 1.0, 1.0);
  BookBench run(config);
  run.run_until(1.0);
  ResistanceTracker tracker(
      {.settings = steady_experiment(false), .known = kKnown, .period_s = run.period_s()});
  const double from_s = run.now_s();
  const AxisParameters cold = run.bench().axis(0).parameters();
  run.bench().submit({.tick = run.bench().tick(),
                      .axis = 0,
                      .owner = 0,
                      .action = write_of(cold, "machine.rotor_resistance_ohm", 1.2 * 8.6, 8000)});
  int estimates = 0;
  double last = 0.0;
  run.run_until(from_s + 2.0, [&](const Sample& s) {
    const auto found = tracker.push(
        {s.i_a_a, s.i_b_a, s.i_c_a, s.u_a_v, s.u_b_v, s.u_c_v, static_cast<double>(s.encoder_count)});
    if (!found) return;
    ++estimates;
    ASSERT_TRUE(found->excitation.sufficient) << found->excitation.verdict;
    const double middle = 1.0 + 0.1 * (run.now_s() - 0.105 - from_s);
    last = found->rotor_time_constant_s;
    EXPECT_NEAR(last, 0.67 / (8.6 * middle), 0.03 * last);
  });
  EXPECT_EQ(estimates, 72);  // (8000 - 840) samples, one estimate every 100
  EXPECT_LT(last, 0.88 * 0.67 / 8.6);
}

/// Estimates of a motor in steady state with these sensors, windows of 0.2 s one after the other.
struct Sensors {
  double load_nm = 3.7;
  double noise_a = 0.02;
  int counts = 4096;
  int period_us = 250;
};

std::vector<ResistanceEstimate> tracked(const Sensors& sensors, int windows, double from_s = 1.5) {
  BenchConfig config = loaded(sensors.load_nm, 1.0, 1.0);
  set_rate(config, 1000LL * sensors.period_us, 1);
  AxisParameters& p = config.setup.axes[0].parameters;
  p.encoder.counts_per_revolution = sensors.counts;
  p.sensors.current.noise_rms_a = sensors.noise_a;
  BookBench run(config);
  run.run_until(from_s);
  Settings e = steady_experiment(false);
  e.counts_per_revolution = sensors.counts;
  e.processing = tracking_processing(100.0, run.period_s(), 0.0);
  const auto window = static_cast<std::size_t>(200'000 / sensors.period_us);
  ResistanceTracker tracker(
      {.settings = e, .known = kKnown, .period_s = run.period_s(), .window = window, .stride = window});
  std::vector<ResistanceEstimate> estimates;
  run.run_until(from_s + 0.2 * windows + 0.03, [&](const Sample& s) {
    if (const auto found = tracker.push(
            {s.i_a_a, s.i_b_a, s.i_c_a, s.u_a_v, s.u_b_v, s.u_c_v, static_cast<double>(s.encoder_count)}))
      estimates.push_back(*found);
  });
  return estimates;
}

bool is_stated(const ResistanceEstimate& e, const char* name) {
  return std::ranges::find(e.excitation.unseen, name) == e.excitation.unseen.end();
}

// A search over load, noise behind 12 bits (none in every third draw), encoder and rate, with a literal seed:
// what is stated lies in its interval in 95 of 100, none is off by a tenth, and without slip nothing is said
// of T_R. A larger search, 6000 windows, found 7263 of 7267 inside and at most 7.1 % of R_S (at 0.09 A). Its
// worst case is the first one here: little load and converter steps that no noise rounds off, 14 % of R_S and
// 17 % of T_R if their scatter alone made the interval. Catches: the pull of noise in the columns; steps that
// err alike in every window.
TEST(Resistances, AreStatedOnlyWhereTheNoiseLetsThem) {
  if (kSanitized) GTEST_SKIP() << kStatistic;
  std::mt19937_64 engine(20261124);
  const auto drawn = [&engine](double low, double high) {
    return low + (high - low) * static_cast<double>(engine() >> 11U) * 0x1p-53;
  };
  int stated = 0;
  int inside = 0;
  for (int draw = 0; draw < 80; ++draw) {
    Sensors sensors = {.load_nm = draw % 5 == 0 ? 0.0 : drawn(0.2, 5.0),
                       .noise_a = draw % 3 == 0 ? 0.0 : drawn(0.003, 0.1),
                       .counts = draw % 2 == 0 ? 1024 : 4096,
                       .period_us = draw % 4 == 0 ? 100 : 250};
    if (draw == 0) sensors = {.load_nm = 0.2477, .noise_a = 0.0, .counts = 1024, .period_us = 100};
    for (const ResistanceEstimate& e : tracked(sensors, 4)) {
      const auto judge_one = [&](const char* name, double value, double truth, double interval) {
        if (!is_stated(e, name)) return;
        ++stated;
        inside += std::abs(value - truth) <= interval ? 1 : 0;
        EXPECT_NEAR(value, truth, 0.1 * truth)
            << name << " at " << sensors.load_nm << " N m, " << sensors.noise_a << " A";
      };
      judge_one("R_S", e.stator_resistance_ohm, 9.7, e.stator_interval_ohm);
      judge_one("T_R", e.rotor_time_constant_s, 0.67 / 8.6, e.rotor_interval_s);
      EXPECT_FALSE(sensors.load_nm == 0.0 && is_stated(e, "T_R"));
    }
  }
  EXPECT_GT(stated, 200);
  EXPECT_GE(inside, 0.95 * stated);
}

// A start: the equations count the speed as constant, which it is not for the first 0.2 s. Under load and a
// little noise all windows after the run-up state both. Catches: R_S 7 % off while the motor runs up; a
// refusal of good data.
TEST(Resistances, NothingIsStatedWhileTheSpeedChanges) {
  const auto start = tracked({}, 1, 0.0);
  ASSERT_EQ(start.size(), 1U);
  EXPECT_FALSE(is_stated(start[0], "R_S"));
  EXPECT_FALSE(is_stated(start[0], "T_R"));
  EXPECT_NE(start[0].excitation.verdict.find("speed"), std::string::npos);
  for (const ResistanceEstimate& e : tracked({}, 5))
    EXPECT_TRUE(e.excitation.sufficient) << e.excitation.verdict;
}

// After a gap the window fills anew: 840 samples, not the stride of 100. Catches: an estimate over samples
// that do not follow each other.
TEST(Resistances, ATrackerBeginsAnewAfterAGap) {
  ResistanceTracker tracker({.settings = steady_experiment(false), .known = kKnown, .period_s = 2.5e-4});
  const auto pushed_until_estimate = [&tracker] {
    for (int count = 1; count < 2000; ++count) {
      const double angle = 0.08 * count;
      if (tracker.push({std::cos(angle), std::cos(angle - 2.1), std::cos(angle + 2.1),
                        300.0 * std::cos(angle + 1.0), 300.0 * std::cos(angle - 1.1),
                        300.0 * std::cos(angle + 3.1), 0.9 * count}))
        return count;
    }
    return 0;
  };
  EXPECT_EQ(pushed_until_estimate(), 840);
  EXPECT_EQ(pushed_until_estimate(), 100);
  tracker.restart();
  EXPECT_EQ(pushed_until_estimate(), 840);
}

// Catches: a tracker that divides by an inductance of zero.
TEST(Resistances, ATrackerWithoutInductancesIsRefused) {
  EXPECT_THROW(ResistanceTracker({.period_s = 1e-3}), IdentificationError);
  EXPECT_THROW(ResistanceTracker({.known = kKnown}), IdentificationError);
}

}  // namespace
}  // namespace drivebench::identification::resistance_tracking_test
