#include "clients/regression/formulas/formula.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <string>

#include "tests/clients/regression/check_on_course.hpp"

namespace drivebench::regression::formula_test {
namespace {

/// Its unit, or the reason why it is none.
std::string unit_or_problem(const std::string& text) {
  const auto parsed = Formula::parse(text);
  if (const auto* const why = std::get_if<std::string>(&parsed)) return *why;
  return std::string(std::get<std::shared_ptr<const Formula>>(parsed)->label().unit);
}

double value_of_formula(const std::string& text) {
  const auto formula = std::get<std::shared_ptr<const Formula>>(Formula::parse(text));
  std::array<Sample, 3> axes{};
  axes[2].speed_rad_s = 7.0;
  axes[0].speed_rad_s = -8.0;
  axes[0].i_a_a = 3.0;
  axes[0].u_a_v = 12.0;
  axes[1].speed_rad_s = 5.0;
  const std::array<std::size_t, 2> places{1, 2};
  return formula->value(axes, 0, places);
}

// Catches: wrong precedence, a difference that associates to the right, a unary minus that binds too tightly.
TEST(Formula, ComputesAsOnPaper) {
  EXPECT_EQ(value_of_formula("1 + 2*3"), 7.0);
  EXPECT_EQ(value_of_formula("10 - 4 - 3"), 3.0);
  EXPECT_EQ(value_of_formula("16/4/2"), 2.0);
  EXPECT_EQ(value_of_formula("-2^2"), -4.0);
  EXPECT_EQ(value_of_formula("2^-1"), 0.5);
  EXPECT_EQ(value_of_formula("(1 + 2)*3"), 9.0);
  EXPECT_EQ(value_of_formula("-(1 - 3)*-2"), -4.0);
  EXPECT_EQ(value_of_formula("1.5e1+.5"), 15.5);
  EXPECT_EQ(value_of_formula("u_a_v*i_a_a - 2 [ohm]*i_a_a^2"), 18.0);
  EXPECT_EQ(value_of_formula("abs(speed_rad_s) + sqrt(u_a_v*i_a_a/1 [W])*0 [rad/s]"), 8.0);
  EXPECT_EQ(value_of_formula("sqrt(16)"), 4.0);
  EXPECT_EQ(value_of_formula("sign(0) + sign(-3)*10"), -10.0);
}

// Catches: a value that is no number and comes out of min, max, sign or abs as one, so that a check of it
// passes.
TEST(Formula, KeepsWhatIsNoNumber) {
  for (const char* const text :
       {"min(1, 0/0)", "min(0/0, 1)", "max(1, sqrt(-1))", "max(0/0, 1)", "sign(0/0)", "abs(0/0)"})
    EXPECT_TRUE(std::isnan(value_of_formula(text))) << text;
}

// Catches: the value of another axis, a minus in the name of an axis that becomes a difference.
TEST(Formula, TakesSignalsOfOtherAxes) {
  EXPECT_EQ(value_of_formula("speed_rad_s - other-axis.speed_rad_s"), -13.0);
  EXPECT_EQ(value_of_formula("max(speed_rad_s, load.speed_rad_s)"), 5.0);
  EXPECT_EQ(value_of_formula("min(speed_rad_s,load.speed_rad_s)*sign(load.speed_rad_s)"), -8.0);
  EXPECT_EQ(value_of_formula("i_a_a-1.5 [A]"), 1.5);
  EXPECT_EQ(value_of_formula("first.speed_rad_s - second.speed_rad_s*10 - first.speed_rad_s"), -70.0);
}

// Catches: units that are not multiplied, a sum of volts and amperes.
TEST(Formula, HasTheUnitOfItsParts) {
  EXPECT_EQ(unit_or_problem("u_a_v*i_a_a"), "W");
  EXPECT_EQ(unit_or_problem("torque_nm*speed_rad_s"), "W");
  EXPECT_EQ(unit_or_problem("u_a_v/i_a_a"), "ohm");
  EXPECT_EQ(unit_or_problem("sqrt(i_a_a^2 + i_b_a^2)"), "A");
  EXPECT_EQ(unit_or_problem("i_a_a/3 [A]"), "1");
  EXPECT_EQ(unit_or_problem("sign(i_a_a)"), "1");
  EXPECT_EQ(unit_or_problem("3 [A/s^2]"), "A/s^2");
  EXPECT_EQ(unit_or_problem("torque_nm/i_a_a^3"), "kg*m^2/s^2/A^3");
  EXPECT_EQ(unit_or_problem("u_a_v + 0.1 [V*s/rad]*speed_rad_s"), "V");
  EXPECT_EQ(unit_or_problem("i_a_a + 2"), "adds A and 1: write a number with its unit as 2 [A]");
  EXPECT_EQ(unit_or_problem("u_a_v - i_a_a"), "subtracts V and A: write a number with its unit as 2 [V]");
  EXPECT_EQ(unit_or_problem("max(u_a_v, 3)"), "compares V and 1: write a number with its unit as 2 [V]");
  EXPECT_EQ(unit_or_problem("sqrt(i_a_a)"), "takes the root of A");
}

// Catches: text that is passed over, a stack that runs over, an exponent that overflows.
TEST(Formula, RefusesWhatIsNone) {
  EXPECT_EQ(unit_or_problem(""), "ends too early");
  EXPECT_EQ(unit_or_problem("1 +"), "ends too early");
  EXPECT_EQ(unit_or_problem("1 2"), "has \"2\" after its end");
  EXPECT_EQ(unit_or_problem("(1"), "lacks a )");
  EXPECT_EQ(unit_or_problem("max(1)"), "lacks the second value of max");
  EXPECT_EQ(unit_or_problem("1 [furlong]"), "has \"furlong\", no unit of a signal or product of some");
  EXPECT_EQ(unit_or_problem("sin(1)"), "\"sin\" is no function: there are abs, sqrt, sign, min and max");
  EXPECT_EQ(unit_or_problem("speed_rad"),
            "\"speed_rad\" is no signal of a bench; did you mean \"speed_rad_s\"?");
  EXPECT_EQ(unit_or_problem("2^10"), "has no whole exponent from -9 to 9 after ^");
  EXPECT_EQ(unit_or_problem("2^0.5"), "has \".5\" after its end");
  EXPECT_EQ(unit_or_problem(std::string(501, '1')), "has more than 500 bytes");
  EXPECT_EQ(unit_or_problem(std::string(200, '(') + "1"), "has too many brackets in each other");
  EXPECT_EQ(unit_or_problem(std::string(200, '-') + "1"), "has too many brackets in each other");
  std::string deep = "1";
  for (int i = 0; i < 40; ++i)
    deep = "1+(" + deep + ")";
  EXPECT_EQ(unit_or_problem(deep), "keeps more than 32 values waiting");
  std::string huge = "i_a_a";
  for (int i = 0; i < 12; ++i)
    huge = "(" + huge + ")^9";
  EXPECT_EQ(unit_or_problem(huge), "has a unit beyond all quantities");
  EXPECT_EQ(unit_or_problem("((i_a_a^9)^9)^9*((i_a_a^9)^9)^9"), "has a unit beyond all quantities");
}

// Catches: a check that leaves its formula out, an energy that is not an integral or that begins with the
// first sample. The speed rises by 1 rad/s a tick, so the trapezoidal rule is exact.
TEST(Formula, StandsInThePlaceOfASignal) {
  const Course rising{.speed = [](std::uint64_t tick) { return static_cast<double>(tick); }};
  const Finding bounds = found("kind = \"bounds\"\nformula = \"2*speed_rad_s\"\nmax = 150\n", rising);
  EXPECT_FALSE(bounds.passed);
  EXPECT_EQ(bounds.measured, 200.0);
  EXPECT_EQ(bounds.unit, "rad/s");
  EXPECT_EQ(bounds.signal, "2*speed_rad_s");
  const Finding energy = found(
      "kind = \"energy\"\nformula = \"3 [N*m]*speed_rad_s\"\nfrom_s = 0.01\nto_s = 0.02\nmax = 1\n", rising);
  EXPECT_NEAR(energy.measured, 3.0 * (0.5 * (10.0 + 20.0) * 10.0 * kPeriod_s), 1e-12);
  EXPECT_EQ(energy.unit, "J");
  EXPECT_TRUE(energy.passed);  // 0.45 J
  const auto passes = [&rising](const std::string& limits) {
    return found(
               "kind = \"energy\"\nformula = \"3 [N*m]*speed_rad_s\"\nfrom_s = 0.01\nto_s = 0.02\n" + limits,
               rising)
        .passed;
  };
  EXPECT_TRUE(passes("min = 0.44\nmax = 0.46"));
  EXPECT_TRUE(passes("min = 0.44"));
  EXPECT_FALSE(passes("max = 0.44"));
  EXPECT_FALSE(passes("min = 0.46"));
  EXPECT_NE(problem_of_check("kind = \"energy\"\nformula = \"3 [W]\"\n").find("needs min, max or both"),
            std::string::npos);
  EXPECT_NE(problem_of_check("kind = \"energy\"\nsignal = \"i_a_a\"\nmax = 1\n").find("needs a power"),
            std::string::npos);
  EXPECT_NE(
      problem_of_check("kind = \"rms\"\nformula = \"1 +\"\nmax = 1\n").find("is \"1 +\" but ends too early"),
      std::string::npos);
}

}  // namespace
}  // namespace drivebench::regression::formula_test
