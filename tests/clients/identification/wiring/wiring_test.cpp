#include "clients/identification/find_wiring.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <string>

#include "clients/identification/identify.hpp"
#include "tests/clients/identification/monte_carlo/random_motors.hpp"
#include "tests/clients/identification/wiring/crossed_wires.hpp"

namespace drivebench::identification::wiring_test {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;

/// Motor 3 of a kind with encoder and converters of 12 bits, white noise of one step.
struct Case {
  const MotorDraw& draw;
  Recorded run;
  int pole_pairs;
  double shift;

  explicit Case(MotorKind kind) : draw(draw_of(kind)), run(record_motor(draw, 3, 1)) {
    pole_pairs = run.how.pole_pairs;
    shift = run.how.processing.voltage_shift;
  }
  static const MotorDraw& draw_of(MotorKind kind) {
    for (const MotorDraw& each : motor_draws()) {
      if (each.kind == kind) return each;
    }
    return motor_draws().front();
  }
  /// Forgets what is to be found.
  void forget() {
    run.how.pole_pairs = 1;
    run.how.reversed = false;
    run.how.zero_rad = 0.0;
  }
};

const WiringFact& fact_of(const std::vector<WiringFact>& facts, const std::string& name) {
  for (const WiringFact& fact : facts) {
    if (fact.name == name) return fact;
  }
  static const WiringFact none;
  ADD_FAILURE() << "no fact " << name;
  return none;
}

std::string text_of(const std::vector<WiringFact>& facts) {
  std::string text;
  for (const WiringFact& fact : facts)
    text += wiring_text(fact) + "\n";
  return text;
}

/// Every parameter is stated, and the truth lies within twice its 95 % interval.
void expect_motor(const Case& c) {
  const Result r = identify(c.run.data, c.run.how);
  EXPECT_TRUE(r.excitation.sufficient) << to_markdown(r);
  const std::vector<double> motor = draw_motor(c.draw, 3);
  for (std::size_t k = 0; k < c.draw.identified.size(); ++k) {
    const Estimate* const e = r.find(c.draw.identified[k].name);
    ASSERT_NE(e, nullptr);
    // A load stands against its own direction of the shaft.
    const double value = e->name == "tau_L" ? std::abs(e->value) : e->value;
    EXPECT_LT(std::abs(value - motor[k]), 2.0 * e->interval.value_or(0.0)) << e->name << "\n"
                                                                           << to_markdown(r);
  }
}

// Catches: pole pairs that are assumed, a sign of the frame, a shift with the wrong sign or half a sample
// off.
TEST(Wiring, IsFoundAsTheBenchHasIt) {
  for (const MotorKind kind :
       {MotorKind::kDc, MotorKind::kInduction, MotorKind::kPmSynchronous, MotorKind::kBldc}) {
    Case c(kind);
    c.forget();
    const std::vector<WiringFact> facts = find_wiring(c.run.data, c.run.how, {});
    EXPECT_EQ(c.run.how.pole_pairs, c.pole_pairs) << text_of(facts);
    EXPECT_FALSE(c.run.how.reversed) << text_of(facts);
    EXPECT_EQ(c.run.how.processing.voltage_shift, c.shift) << text_of(facts);
    EXPECT_EQ(c.run.how.zero_rad, 0.0) << text_of(facts);
    for (const WiringFact& fact : facts) {
      EXPECT_TRUE(fact.found.has_value()) << text_of(facts);
      EXPECT_FALSE(fact.contradicts) << text_of(facts);
    }
  }
}

// The voltages' column two samples late, the encoder backwards and with another zero: a motor within its
// intervals all the same. Catches: a direction that turns the speed and not the frame, a zero in the wrong
// direction, a delay that is cut to half a sample.
TEST(Wiring, AReversedEncoderAnyZeroAndLateVoltagesAreFound) {
  for (const MotorKind kind :
       {MotorKind::kDc, MotorKind::kInduction, MotorKind::kPmSynchronous, MotorKind::kBldc}) {
    Case c(kind);
    const bool magnet = kind == MotorKind::kPmSynchronous || kind == MotorKind::kBldc;
    cross(c.run.data, {.reversed = true, .zero_counts = magnet ? 37 : 0, .late_samples = 2});
    c.forget();
    const std::vector<WiringFact> facts = find_wiring(c.run.data, c.run.how, {});
    EXPECT_EQ(c.run.how.pole_pairs, c.pole_pairs) << text_of(facts);
    EXPECT_TRUE(c.run.how.reversed) << text_of(facts);
    EXPECT_EQ(c.run.how.processing.voltage_shift, c.shift + 2.0) << text_of(facts);
    if (magnet) {
      const double zero = 37.0 * kTurn / c.run.how.counts_per_revolution;
      EXPECT_NEAR(std::remainder(c.run.how.zero_rad - zero, kTurn / c.pole_pairs), 0.0, 0.03 / c.pole_pairs)
          << text_of(facts);
    }
    expect_motor(c);
  }
}

// Two crossed phases look like a reversed encoder. Catches: a guess which of the two it is.
TEST(Wiring, CrossedPhasesAreToldAsEither) {
  Case c(MotorKind::kInduction);
  cross(c.run.data, {.crossed = true});
  const std::vector<WiringFact> facts = find_wiring(c.run.data, c.run.how, {});
  EXPECT_EQ(fact_of(facts, "direction").found, -1.0) << text_of(facts);
  EXPECT_NE(fact_of(facts, "direction").remark.find("or two crossed phases"), std::string::npos);
  expect_motor(c);
}

// Catches: a setting that is replaced in silence, or that stands without a word.
TEST(Wiring, ASettingThatTheDataContradictIsTold) {
  Case c(MotorKind::kPmSynchronous);
  cross(c.run.data, {.reversed = true, .late_samples = 1});
  c.run.how.pole_pairs = 49;
  const std::vector<WiringFact> facts = find_wiring(
      c.run.data, c.run.how, {.pole_pairs = true, .direction = true, .voltage_shift = true, .zero = true});
  EXPECT_EQ(c.run.how.pole_pairs, 49);
  EXPECT_FALSE(c.run.how.reversed);
  EXPECT_EQ(c.run.how.processing.voltage_shift, 0.5);
  for (const char* name : {"pole_pairs", "direction", "voltage_shift"})
    EXPECT_TRUE(fact_of(facts, name).contradicts) << name << "\n" << text_of(facts);
  EXPECT_EQ(fact_of(facts, "pole_pairs").found, 50.0);
  EXPECT_NE(wiring_text(fact_of(facts, "pole_pairs")).find("BUT THE DATA SAY 50"), std::string::npos);
}

// The first 5 ms of a start: the shaft has hardly moved, so that any pole pairs do. Catches: the best of
// hypotheses that explain the record alike, stated.
TEST(Wiring, AStandingMotorLeavesPolePairsOpen) {
  Case c(MotorKind::kInduction);
  c.run.how.pole_pairs = 7;
  c.run.how.processing.from_s = 0.002;
  c.run.how.processing.to_s = 0.005;
  const std::vector<WiringFact> facts = find_wiring(c.run.data, c.run.how, {});
  EXPECT_FALSE(fact_of(facts, "pole_pairs").found.has_value()) << text_of(facts);
  EXPECT_FALSE(fact_of(facts, "direction").found.has_value()) << text_of(facts);
  EXPECT_EQ(c.run.how.pole_pairs, 7);
  EXPECT_NE(fact_of(facts, "pole_pairs").remark, "");
}

// The first 50 ms of a swing: the shaft turns by less than the encoder's steps can tell from noise. Catches:
// a zero that is told as found, give or take 1e11 rad.
TEST(Wiring, AMagnetThatHardlyTurnsLeavesItsZeroOpen) {
  Case c(MotorKind::kPmSynchronous);
  c.run.how.processing.from_s = 0.001;
  c.run.how.processing.to_s = 0.05;
  const std::vector<WiringFact> facts =
      find_wiring(c.run.data, c.run.how, {.pole_pairs = true, .direction = true, .zero = true});
  const WiringFact& zero = fact_of(facts, "zero");
  EXPECT_FALSE(zero.found.has_value()) << text_of(facts);
  EXPECT_NE(wiring_text(zero).find("as set; the motor hardly turns"), std::string::npos) << text_of(facts);
}

// A DC motor that turns steadily at a steady voltage: only the voltages' noise changes. Catches: a shift that
// noise makes, with a deviation of 0.02 samples from a least squares that takes its columns for exact.
TEST(Wiring, SteadyVoltagesLeaveTheShiftOpen) {
  std::mt19937_64 engine(1);
  std::normal_distribution<double> white;
  MeasuredData data{.period_s = 1e-4,
                    .columns = {{"u_a_v", "V", {}}, {"i_a_a", "A", {}}, {"encoder_count", "counts", {}}}};
  for (int k = 0; k < 5000; ++k) {
    data.columns[0].values.push_back(10.0 + 0.01 * white(engine));
    data.columns[1].values.push_back(1.0 + 0.01 * white(engine));
    data.columns[2].values.push_back(std::floor(3.3 * k));
  }
  Settings e{.kind = MotorKind::kDc, .counts_per_revolution = 2000.0};
  e.processing = usual_processing(e.kind, data.period_s);
  e.processing.voltage_shift = -3.5;
  const std::vector<WiringFact> facts = find_wiring(data, e, {});
  EXPECT_FALSE(fact_of(facts, "voltage_shift").found.has_value()) << text_of(facts);
  EXPECT_EQ(e.processing.voltage_shift, -3.5);
}

// The PM motor at a constant voltage that turns with it: all signals are one phasor, which a resistance and
// an inductance explain without a magnet. Catches: pole pairs, or a shift, from such data.
TEST(Wiring, APhasorLeavesPolePairsAndShiftOpen) {
  Case c(MotorKind::kPmSynchronous);
  std::mt19937_64 engine(2);
  std::normal_distribution<double> white;
  const double step = kTurn / 60.0;
  for (Column& column : c.run.data.columns) {
    for (std::size_t k = 0; k < column.values.size(); ++k) {
      const double angle = step * static_cast<double>(k);
      const bool a = column.name[2] == 'a';
      if (column.name[0] == 'u')
        column.values[k] = 10.0 * (a ? -std::sin(angle) : std::cos(angle)) + 0.02 * white(engine);
      if (column.name[0] == 'i') column.values[k] = a ? std::cos(angle - 1.0) : std::sin(angle - 1.0);
      if (column.name[0] == 'i') column.values[k] += 0.01 * white(engine);
      if (column.name[0] == 'e')
        column.values[k] = std::floor(angle / 50.0 / kTurn * c.run.how.counts_per_revolution);
    }
  }
  const std::vector<WiringFact> facts = find_wiring(c.run.data, c.run.how, {});
  EXPECT_FALSE(fact_of(facts, "pole_pairs").found.has_value()) << text_of(facts);
  EXPECT_FALSE(fact_of(facts, "voltage_shift").found.has_value()) << text_of(facts);
}

}  // namespace
}  // namespace drivebench::identification::wiring_test
