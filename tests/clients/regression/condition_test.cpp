#include "clients/regression/checks/condition.hpp"

#include <gtest/gtest.h>

#include <string>

namespace drivebench::regression {
namespace {

bool holds(std::string_view text, const Sample& sample) {
  const Condition::Parsed parsed = Condition::parse(text);
  EXPECT_TRUE(parsed.condition.has_value()) << parsed.problem;
  return parsed.condition && parsed.condition->holds(sample);
}

// Catches: two operators that are mistaken for each other, or an equal value on the wrong side.
TEST(Condition, ComparesWithEveryOperator) {
  Sample sample;
  sample.speed_rad_s = 100.0;
  EXPECT_FALSE(holds("speed_rad_s > 100", sample));
  EXPECT_TRUE(holds("speed_rad_s >= 100", sample));
  EXPECT_FALSE(holds("speed_rad_s < 100", sample));
  EXPECT_TRUE(holds("speed_rad_s<=1e2", sample));
  EXPECT_TRUE(holds("speed_rad_s == 100.0", sample));
  EXPECT_FALSE(holds("speed_rad_s != 100", sample));
  EXPECT_TRUE(holds("speed_rad_s > -0.5", sample));
}

// Catches: a mask that is not applied, or that compares all bits.
TEST(Condition, MasksWholeNumbers) {
  Sample sample;
  sample.faults = 0x104;
  EXPECT_TRUE(holds("faults & 4 != 0", sample));
  EXPECT_FALSE(holds("faults & 2 != 0", sample));
  EXPECT_TRUE(holds("faults & 260 == 260", sample));
}

// Catches: a typing error that becomes a condition which never holds.
TEST(Condition, RefusesWhatItDoesNotUnderstand) {
  const auto problem = [](std::string_view text) { return Condition::parse(text).problem; };
  EXPECT_NE(problem("sped_rad_s > 1").find("did you mean \"speed_rad_s\"?"), std::string::npos);
  EXPECT_NE(problem("speed_rad_s > fast").find("one finite number"), std::string::npos);
  EXPECT_NE(problem("speed_rad_s > inf").find("one finite number"), std::string::npos);
  EXPECT_NE(problem("speed_rad_s > 1 2").find("one finite number"), std::string::npos);
  EXPECT_NE(problem("speed_rad_s => 1").find("without a comparison"), std::string::npos);
  EXPECT_NE(problem("speed_rad_s & 4 != 0").find("no whole number"), std::string::npos);
  EXPECT_NE(problem("faults & 0 != 0").find("mask"), std::string::npos);
  EXPECT_NE(problem("").find("the form is"), std::string::npos);
}

}  // namespace
}  // namespace drivebench::regression
