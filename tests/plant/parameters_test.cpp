#include "plant/parameters/parameters.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <string>

#include "tests/plant/servo_axis.hpp"

namespace drivebench::parameters_test {
namespace {

bool names(const std::vector<Problem>& found, std::string_view field) {
  return std::any_of(found.begin(), found.end(), [field](const Problem& p) { return p.field == field; });
}

/// An axis with each kind of machine, everything at its default.
std::vector<AxisParameters> all_kinds() {
  std::vector<AxisParameters> result;
  for (std::size_t kind = 0; kind < machine_kinds().size(); ++kind)
    result.emplace_back().machine = make_machine(kind);
  return result;
}

const Parameter* find_of_servo(std::string_view name) {
  return find_parameter(servo_axis(), name);
}

// Catches: a limit that excludes the machine of the book.
TEST(Parameters, TheServoMotorHasNoProblems) {
  EXPECT_TRUE(problems(servo_axis()).empty());
}

// Catches: a check that stops at the first problem.
TEST(Parameters, EveryWrongParameterIsListedAtOnce) {
  for (AxisParameters p : all_kinds()) {
    std::set<std::string> expected;
    for (const Parameter& row : axis_parameters(p)) {
      row.set(p, row.integer ? row.minimum - 1.0 : -2e9);
      const bool is_switch = row.integer && row.minimum == 0.0 && row.maximum == 1.0 && row.words.empty();
      if (!is_switch) expected.insert(std::string(row.name));  // a switch has no wrong value
    }
    std::set<std::string> found;
    for (const Problem& problem : problems(p)) {
      found.insert(problem.field);
      EXPECT_FALSE(problem.rule.empty());
    }
    for (const std::string& name : expected)
      EXPECT_TRUE(found.contains(name)) << machine_kind(p) << " " << name;
  }
}

// An empty configuration is all zeros. Catches: the division by L_R L_S = 0 (seen by
// -fsanitize=float-divide-by-zero) and the noise of a leakage factor that is not a number.
TEST(Parameters, AnAxisOfZerosIsRefusedByEachRequiredParameter) {
  const std::vector<Problem> found = problems(AxisParameters{});
  EXPECT_TRUE(names(found, "machine.rotor_inductance_h"));
  EXPECT_TRUE(names(found, "machine.stator_inductance_h"));
  EXPECT_TRUE(names(found, "mechanics.inertia_kgm2"));
  EXPECT_TRUE(names(found, "amplifier.voltage_limit_v"));
  for (const Problem& problem : found)
    EXPECT_EQ(problem.rule.find("sigma"), std::string::npos) << problem.rule;
}

// Catches: a machine without leakage, whose equations divide by zero, or with a negative one.
TEST(Parameters, ALeakageFactorOfZeroOrLessIsRefusedByName) {
  AxisParameters p = servo_axis();
  for (const double mutual_h : {0.014, 0.015}) {
    induction(p).mutual_inductance_h = mutual_h;
    const std::vector<Problem> found = problems(p);
    ASSERT_EQ(found.size(), 1u);
    EXPECT_EQ(found[0].field, "machine.mutual_inductance_h");
    EXPECT_NE(found[0].rule.find("sigma"), std::string::npos) << found[0].rule;
  }
  induction(p).mutual_inductance_h = 0.0139;
  EXPECT_TRUE(problems(p).empty());
}

// Catches: rules between parameters that are not checked.
TEST(Parameters, StictionBelowCoulombFrictionAndCountsThatAreNoMultipleOfFourAreRefused) {
  AxisParameters p = servo_axis();
  p.mechanics.coulomb_friction_nm = 0.02;
  p.mechanics.static_friction_nm = 0.0199;
  p.encoder.counts_per_revolution = 2002;
  const std::vector<Problem> found = problems(p);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0].field, "mechanics.static_friction_nm");
  EXPECT_EQ(found[1].field, "encoder.counts_per_revolution");
  p.mechanics.static_friction_nm = 0.02;
  p.encoder.counts_per_revolution = 2000;
  EXPECT_TRUE(problems(p).empty());
}

// Catches: a limit that is open where it should be closed, NaN that passes a comparison, fractions of
// integers.
TEST(Parameters, TheLimitsBelongToTheRangeAndNothingElsePasses) {
  for (const AxisParameters& p : all_kinds()) {
    for (const Parameter& row : axis_parameters(p)) {
      EXPECT_EQ(problem_with(row, row.minimum), "") << row.name;
      EXPECT_EQ(problem_with(row, row.maximum), "") << row.name;
      constexpr double kInfinity = std::numeric_limits<double>::infinity();
      for (const double value :
           {std::nextafter(row.minimum, -kInfinity), std::nextafter(row.maximum, kInfinity), kInfinity,
            -kInfinity, std::numeric_limits<double>::quiet_NaN()}) {
        EXPECT_NE(problem_with(row, value), "") << row.name << " = " << value;
      }
      EXPECT_EQ(problem_with(row, row.minimum + 0.5).empty(),
                !row.integer && row.maximum - row.minimum >= 0.5)
          << row.name;
    }
  }
}

// Catches: a row that reads one member and writes another, two rows for one member or with one name.
TEST(Parameters, EachRowReadsWhatItWritesAndTouchesNothingElse) {
  for (const AxisParameters& fresh : all_kinds()) {
    std::set<std::string_view> seen;
    for (const Parameter& row : axis_parameters(fresh)) {
      EXPECT_TRUE(seen.insert(row.name).second) << row.name;
      EXPECT_EQ(find_parameter(fresh, row.name), &row);
      EXPECT_FALSE(row.unit.empty());
      EXPECT_FALSE(row.meaning.empty());
      AxisParameters p = fresh;
      const double value = row.get(p) == row.maximum ? row.minimum : row.maximum;
      row.set(p, value);
      for (const Parameter& other : axis_parameters(p)) {
        EXPECT_EQ(other.get(p), &other == &row ? value : other.get(fresh)) << row.name << " / " << other.name;
      }
    }
  }
  EXPECT_EQ(find_of_servo("machine.rotor_resistence_ohm"), nullptr);
  EXPECT_EQ(find_of_servo(""), nullptr);
}

// Catches: a parameter that the encoder or the converter has copied at the start, declared writable while
// running.
TEST(Parameters, ParametersThatAreFixedAtTheStartAreNotLive) {
  for (const std::string_view name : {"machine.pole_pairs", "encoder.counts_per_revolution",
                                      "encoder.half_count_offset", "current_sensor.bits"}) {
    EXPECT_FALSE(find_of_servo(name)->live) << name;
  }
  EXPECT_TRUE(find_of_servo("machine.rotor_resistance_ohm")->live);
}

// Catches: a sentence without the value or the limits.
TEST(Parameters, ARuleNamesTheValueTheLimitsAndTheUnit) {
  const Parameter& row = *find_of_servo("machine.rotor_resistance_ohm");
  EXPECT_EQ(problem_with(row, -3.5), "is -3.5 but must lie between 1e-06 and 1e+06 ohm");
  EXPECT_EQ(problem_with(*find_of_servo("machine.pole_pairs"), 1.5), "is 1.5 but must be a whole number");
}

}  // namespace
}  // namespace drivebench::parameters_test
