#include "protocols/condition.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "protocols/signals/catalogue.hpp"

namespace drivebench::condition_test {
namespace {

Condition condition(const std::string& text) {
  const auto parsed = parse_condition(text);
  const auto* const why = std::get_if<std::string>(&parsed);
  EXPECT_EQ(why, nullptr) << text << ": " << *why;
  return why == nullptr ? std::get<NamedCondition>(parsed).condition : Condition{};
}

std::string problem_of(const std::string& text) {
  const auto parsed = parse_condition(text);
  const auto* const why = std::get_if<std::string>(&parsed);
  return why == nullptr ? "" : *why;
}

// Catches: a comparison that is read as another one, or that is wrong at equality.
TEST(Condition, EveryComparisonIsExactAtItsNumber) {
  const std::vector<std::pair<std::string, std::vector<bool>>> expected = {
      // for 1, 2 and 3
      {"speed_rad_s > 2", {false, false, true}},  {"speed_rad_s >= 2", {false, true, true}},
      {"speed_rad_s < 2", {true, false, false}},  {"speed_rad_s <= 2", {true, true, false}},
      {"speed_rad_s == 2", {false, true, false}}, {"speed_rad_s!=2", {true, false, true}}};
  for (const auto& [text, holds] : expected) {
    for (std::size_t i = 0; i < holds.size(); ++i) {
      Sample sample;
      sample.speed_rad_s = 1.0 + static_cast<double>(i);
      EXPECT_EQ(condition(text).holds(sample), holds[i]) << text << " for " << sample.speed_rad_s;
    }
  }
}

// Catches: a value that is not a number and passes for a large or a small one.
TEST(Condition, NotANumberOnlyDiffers) {
  Sample sample;
  sample.torque_nm = std::numeric_limits<double>::quiet_NaN();
  for (const std::string comparison : {">", ">=", "<", "<=", "=="})
    EXPECT_FALSE(condition("torque_nm " + comparison + " 0").holds(sample)) << comparison;
  EXPECT_TRUE(condition("torque_nm != 0").holds(sample));
}

// Catches: bits that are compared without their mask, and a signed or an unsigned signal read as a real one.
TEST(Condition, BitsAndWholeNumbersAreReadAsTheyAre) {
  Sample sample;
  sample.faults = 0x14;
  sample.encoder_count = -7;
  EXPECT_TRUE(condition("faults & 4 != 0").holds(sample));
  EXPECT_FALSE(condition("faults & 0x8 != 0").holds(sample));
  EXPECT_TRUE(condition("faults & 0x1c == 20").holds(sample));
  EXPECT_TRUE(condition("encoder_count < -6.5").holds(sample));
}

// Catches: a text that changes its condition on the way to a file and back.
TEST(Condition, ItsTextReadsBackTheSame) {
  for (const std::string text :
       {"  speed_rad_s>1e-3 ", "faults & 0xff != 0", "encoder_count <= -12", "state == 4"}) {
    const Condition one = condition(text);
    const Condition other = condition(text_of(one));
    EXPECT_EQ(one.signal, other.signal) << text;
    EXPECT_EQ(one.mask, other.mask) << text;
    EXPECT_EQ(one.comparison, other.comparison) << text;
    EXPECT_EQ(one.number, other.number) << text;
  }
  EXPECT_EQ(text_of(condition("faults & 0xff != 0")), "faults & 255 != 0");
}

// Catches: the name of an axis that is taken for a part of the signal; such names may hold dots.
TEST(Condition, AnAxisMayStandBeforeTheSignal) {
  const auto parsed = parse_condition("press.left.speed_rad_s > 1");
  ASSERT_TRUE(std::holds_alternative<NamedCondition>(parsed));
  EXPECT_EQ(std::get<NamedCondition>(parsed).axis, "press.left");
  EXPECT_EQ(text_of(std::get<NamedCondition>(parsed).condition), "speed_rad_s > 1");
}

// Catches: a text that is read in part, and a refusal that does not say why.
TEST(Condition, AWrongTextIsRefusedInWords) {
  EXPECT_EQ(problem_of("sped_rad_s > 1"), "there is no signal 'sped_rad_s'; did you mean 'speed_rad_s'?");
  EXPECT_NE(problem_of("").find("as in 'speed_rad_s > 100'"), std::string::npos);
  EXPECT_NE(problem_of("speed_rad_s & 4 != 0").find("is no word of bits"), std::string::npos);
  EXPECT_NE(problem_of("faults & 0 != 0").find("above 0"), std::string::npos);
  EXPECT_NE(problem_of("faults & -4 != 0").find("above 0"), std::string::npos);
  EXPECT_NE(problem_of("speed_rad_s = 1").find("one of > >= < <= == !="), std::string::npos);
  for (const std::string rest : {"", "x", "nan", "inf", "1e999", "1 2", "1;", "1 && state == 4"})
    EXPECT_NE(problem_of("speed_rad_s > " + rest).find("one finite number"), std::string::npos) << rest;
}

}  // namespace
}  // namespace drivebench::condition_test
