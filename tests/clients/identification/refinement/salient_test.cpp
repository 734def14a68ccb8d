#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "clients/identification/find_wiring.hpp"
#include "clients/identification/identify.hpp"
#include "clients/identification/resimulation.hpp"
#include "tests/clients/identification/monte_carlo/random_motors.hpp"
#include "tests/clients/identification/wiring/crossed_wires.hpp"

namespace drivebench::identification::salient_test {
namespace {

const MotorDraw& draw_of(bool salient) {
  return *std::ranges::find_if(motor_draws(), [&](const MotorDraw& draw) {
    return draw.kind == MotorKind::kPmSynchronous && (draw.iron == Iron::kSalient) == salient;
  });
}

/// Motor `number` of the salient draw with an L_q of so many L_d; 12-bit converters with a step of noise,
/// encoder of 4096 counts.
struct Salient {
  std::vector<double> motor;
  Recorded run;

  Salient(int number, double ratio) : motor(draw_motor(draw_of(true), number)) {
    motor[2] = ratio * motor[1];
    run = record_motor(draw_of(true), motor, static_cast<std::uint64_t>(number));
  }
};

/// The truth lies within 1.5 times each 95 % interval: three standard deviations.
void expect_motor(const Salient& c, const Result& r) {
  EXPECT_TRUE(r.excitation.sufficient) << to_markdown(r);
  const MotorDraw& draw = draw_of(true);
  for (std::size_t k = 0; k < draw.identified.size(); ++k) {
    const Estimate* const e = r.find(draw.identified[k].name);
    ASSERT_NE(e, nullptr) << to_markdown(r);
    EXPECT_LT(std::abs(e->value - c.motor[k]), 1.5 * e->interval.value_or(0.0)) << to_markdown(r);
  }
  const double l_g = 0.5 * (c.motor[1] - c.motor[2]);
  EXPECT_LT(std::abs(r.at("L_g") - l_g), 1.5 * *r.find("L_g")->interval) << to_markdown(r);
}

// From a hundredth to nine times, in both directions: what the noise lets through is found. Catches: L_d for
// L_q, a difference that must be large to be seen, a rotor whose L_q is the smaller one taken for round.
TEST(SalientRotor, BothInductancesAreFound) {
  for (const double ratio : {0.5, 1.01, 2.3, 9.0}) {
    const Salient c(3, ratio);
    const Result r = identify(c.run.data, c.run.how);
    ASSERT_TRUE(is_salient(r)) << ratio << "\n" << to_markdown(r);
    expect_motor(c, r);
    const Resimulation again = resimulate(c.run.data, c.run.how, r);
    for (const Resimulated& signal : again.signals)
      EXPECT_LT(signal.normalised, 0.02) << ratio << " " << signal.name;
  }
}

// Round rotors of two experiments keep their L_S, and the report says how large L_g may be. Catches: noise
// that passes for a saliency, an L_S that is worse than without the question: its truth lies within 1.5
// intervals, which are below 0.1 % with exact voltages.
TEST(SalientRotor, ARoundRotorHasOneInductance) {
  std::vector<std::pair<Recorded, double>> round;
  MotorDraw exact = draw_of(false);
  exact.converts_voltages = false;
  round.emplace_back(record_motor(exact, 1, 1), draw_motor(exact, 1)[1]);
  const Salient same(4, 1.0);
  round.emplace_back(same.run, same.motor[1]);
  for (const auto& [run, inductance_h] : round) {
    const Result r = identify(run.data, run.how);
    EXPECT_TRUE(r.excitation.sufficient) << to_markdown(r);
    EXPECT_FALSE(is_salient(r));
    const Estimate* const l_s = r.find("L_S");
    ASSERT_NE(l_s, nullptr);
    EXPECT_LT(std::abs(l_s->value - inductance_h), 1.5 * *l_s->interval) << to_markdown(r);
    EXPECT_LT(*l_s->interval, 1e-3 * inductance_h);
    ASSERT_FALSE(r.notes.empty());
    EXPECT_NE(r.notes.back().find("taken as one L_S"), std::string::npos) << r.notes.back();
  }
}

// A rotor that is known is not asked for, and the parameters come out as they would have. Catches: a setting
// that nobody reads, one that makes a round motor salient.
TEST(SalientRotor, OneThatIsKnownIsTaken) {
  Salient c(3, 2.3);
  c.run.how.rotor = Rotor::kSalient;
  const Result known = identify(c.run.data, c.run.how);
  c.run.how.rotor = Rotor::kAsTheDataSay;
  EXPECT_EQ(known.at("L_q"), identify(c.run.data, c.run.how).at("L_q"));
  c.run.how.rotor = Rotor::kRound;
  EXPECT_FALSE(is_salient(identify(c.run.data, c.run.how)));
}

// Voltages three samples late, an encoder backwards with another zero. Catches: a wiring that asks the
// equations of a round rotor, which find none or a wrong one for two of three such motors.
TEST(SalientRotor, ItsWiringIsFound) {
  Salient c(5, 3.0);
  cross(c.run.data, {.reversed = true, .zero_counts = 1234, .late_samples = 3});
  Settings e = c.run.how;
  e.pole_pairs = 1;
  e.processing.voltage_shift = 0.0;
  find_wiring(c.run.data, e, {});
  EXPECT_EQ(e.pole_pairs, 4);
  EXPECT_TRUE(e.reversed);
  EXPECT_EQ(e.processing.voltage_shift, 3.5);
  expect_motor(c, identify(c.run.data, e));
}

// Pole pairs that are not the motor's. Catches: a saliency that explains what it cannot.
TEST(SalientRotor, AnotherMotorIsRefused) {
  Salient c(6, 2.0);
  c.run.how.pole_pairs = 3;
  const Result r = identify(c.run.data, c.run.how);
  EXPECT_FALSE(r.excitation.sufficient) << to_markdown(r);
  EXPECT_NE(r.excitation.verdict.find("no motor of this kind"), std::string::npos) << r.excitation.verdict;
}

}  // namespace
}  // namespace drivebench::identification::salient_test
