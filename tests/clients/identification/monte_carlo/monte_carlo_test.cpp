#include "tests/clients/identification/monte_carlo/monte_carlo.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <set>
#include <sstream>
#include <string>

#include "clients/identification/data/noise.hpp"
#include "tests/clients/identification/monte_carlo/random_motors.hpp"

namespace drivebench::identification::monte_carlo_test {
namespace {

/// The motors that the table shows one by one, run once for all tests.
const std::vector<Trials>& shown() {
  static const std::vector<Trials> trials = run_table({.motors = kShownMotors, .noises = 1, .threads = 2});
  return trials;
}

// Catches: a change of plant, sensors, filters or regression that the table does not have, and a table
// written by hand.
TEST(MonteCarlo, TheTableEqualsTheResultsOfTheExperiments) {
  std::ifstream file(DRIVEBENCH_IDENTIFICATION, std::ios::binary);
  ASSERT_TRUE(file) << DRIVEBENCH_IDENTIFICATION;
  std::ostringstream text;
  text << file.rdbuf();
  for (const std::string& difference : differences(text.str(), shown(), run_verdicts(motor_draws(), 1, 2)))
    ADD_FAILURE() << difference;
}

// Catches: numbers that depend on the thread that works them out: a state that trials share, an order of
// threads.
TEST(MonteCarlo, ThreadsDoNotChangeABit) {
  constexpr int kMotors = 2;
  const auto alone = run_trials(motor_draws(), {.motors = kMotors, .noises = 1, .threads = 1});
  for (std::size_t kind = 0; kind < alone.size(); ++kind) {
    for (std::size_t motor = 0; motor < kMotors; ++motor) {
      for (std::size_t k = 0; k < alone[kind].findings[motor].size(); ++k) {
        EXPECT_EQ(alone[kind].findings[motor][k].estimate, shown()[kind].findings[motor][k].estimate);
        EXPECT_EQ(alone[kind].findings[motor][k].index, shown()[kind].findings[motor][k].index);
      }
    }
  }
}

/// The smallest distance between two values that a signal takes.
double step_of(const Series& x) {
  const std::set<double> values(x.begin(), x.end());
  double step = *values.rbegin() - *values.begin();
  for (auto upper = std::next(values.begin()); upper != values.end(); ++upper)
    step = std::min(step, *upper - *std::prev(upper));
  return step;
}

// The table says 12 bits and a noise of one step rms for currents and voltages. Required is half a step,
// which is more than a converter without noise shows (0.29) and less than the median of noise and rounding
// (1.04). Catches: exact voltages, because their converter is not there; a noise of zero.
TEST(MonteCarlo, CurrentsAndVoltagesHaveTheNoiseOfTheirConverters) {
  constexpr double kSteps = 4096.0;
  std::vector<const MotorDraw*> draws{&saturated_draw()};
  for (const MotorDraw& draw : motor_draws())
    draws.push_back(&draw);
  for (const MotorDraw* draw : draws) {
    const Recorded run = record_motor(*draw, 1, 1);
    for (const Column& column : run.data.columns) {
      if (!column.name.starts_with("i_") && !column.name.starts_with("u_")) continue;
      SCOPED_TRACE(std::string(draw->name) + " " + column.name);
      const auto [least, most] = std::ranges::minmax(column.values);
      const double step = step_of(column.values);
      EXPECT_LT(most - least, 1.001 * kSteps * step);
      EXPECT_GT(white_noise(column.values), 0.5 * step);
    }
  }
}

// Catches: noise that is the same in every experiment: another noise moves every estimate, by less than a
// tenth.
TEST(MonteCarlo, EachExperimentHasItsOwnNoise) {
  for (const Trials& kind : shown()) {
    const std::vector<Finding> again = identify_motor(*kind.draw, 1, 2);
    for (std::size_t k = 0; k < again.size(); ++k) {
      EXPECT_NE(again[k].estimate, kind.findings[0][k].estimate) << kind.draw->name << " " << k;
      EXPECT_NEAR(again[k].estimate, kind.findings[0][k].estimate, 0.1 * again[k].truth);
    }
  }
}

// Catches: a comparison that is content with another number, another text, a row less or a row more, and a
// summary that counts wrong: of the errors 1, 2, 2, 4 % with an interval of 3 % and one estimate taken back
// the median is 2 %, the worst 4 %, three of four are covered. The median interval is 1.5 times that error;
// that of exact intervals of one width is 1.96/0.6745 = 2.91 times theirs.
TEST(MonteCarlo, DifferencesAreFound) {
  const auto finding = [](double error, bool stated) {
    return Finding{.truth = 2.0,
                   .by_equations = 2.0 + 4.0 * error,
                   .index = 0.09,
                   .estimate = 2.0 + 2.0 * error,
                   .interval = 0.06,
                   .stated = stated};
  };
  const Range range[] = {{"R", "ohm", 1.0, 4.0}};
  const MotorDraw draw = {.kind = MotorKind::kDc,
                          .name = "motors",
                          .bench = "bench",
                          .experiment = "A run.",
                          .identified = range,
                          .others = {},
                          .longest_s = 0.0};
  Trials trials{.draw = &draw, .noises = 1, .findings{}};
  for (const double error : {0.01, -0.02, 0.04})
    trials.findings.push_back({finding(error, true)});
  trials.findings.push_back({finding(0.5, false)});
  trials.findings.push_back({finding(0.02, true)});
  const std::string text = markdown_of({trials}, {});
  EXPECT_NE(text.find("| R | 1 to 4 ohm | 4.00 % | 8.00 % | 75.0 % | 2.00 % | 4.00 % | 4.00 % (no. 3) | 75.0 "
                      "% | 3.00 % | 1.50 (2.91) | 1 |"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("| 4 | 2: not stated |"), std::string::npos) << text;
  EXPECT_TRUE(differences(text, {trials}, {}).empty());
  const auto with = [&](const std::string& old_part, const std::string& new_part) {
    std::string changed = text;
    changed.replace(changed.find(old_part), old_part.size(), new_part);
    return differences(changed, {trials}, {}).size();
  };
  EXPECT_EQ(with("2: 1.00 %", "2: 1.02 %"), 0U);
  EXPECT_EQ(with("2: 1.00 %", "2: 1.03 %"), 1U);
  EXPECT_EQ(with("( 3.00 % )", "( 3.08 % )"), 1U);
  EXPECT_EQ(with("2: not stated", "2: 50.0 % ( 3.00 % )"), 1U);
  EXPECT_EQ(with("1 to 4 ohm", "1 to 5 ohm"), 1U);
  EXPECT_EQ(with("A run.", "Another run."), 1U);
  EXPECT_EQ(with("## motors", "## engines"), 1U);
  EXPECT_EQ(differences(text + "more\n", {trials}, {}).size(), 1U);
  EXPECT_EQ(differences("", {trials}, {}).size(), 1U);
}

}  // namespace
}  // namespace drivebench::identification::monte_carlo_test
