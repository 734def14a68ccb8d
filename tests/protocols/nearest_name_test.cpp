#include "protocols/nearest_name.hpp"

#include <gtest/gtest.h>

#include <array>
#include <string>
#include <string_view>
#include <vector>

namespace drivebench::nearest_name_test {
namespace {

constexpr std::array<std::string_view, 4> kKnown = {"period_us", "channel", "stator_inductance_h",
                                                    "rotor_inductance_h"};

// Catches: a distance that counts a letter twice or misses one at an end.
TEST(NearestName, DistanceCountsInsertedDroppedAndChangedLetters) {
  EXPECT_EQ(edit_distance("", ""), 0U);
  EXPECT_EQ(edit_distance("", "abc"), 3U);
  EXPECT_EQ(edit_distance("abc", ""), 3U);
  EXPECT_EQ(edit_distance("abc", "abc"), 0U);
  EXPECT_EQ(edit_distance("chanel", "channel"), 1U);
  EXPECT_EQ(edit_distance("xchannel", "channel"), 1U);
  EXPECT_EQ(edit_distance("kitten", "sitting"), 3U);
}

// Catches: a suggestion further away than another, and a part of a name that is taken for a misspelling of a
// shorter one.
TEST(NearestName, ContainsTheNameOrDiffersLeast) {
  EXPECT_EQ(nearest_name("peroid_us", kKnown), "period_us");
  EXPECT_EQ(nearest_name("inductance", kKnown), "stator_inductance_h");
  EXPECT_EQ(nearest_name("rotor_inductanse_h", kKnown), "rotor_inductance_h");
}

// Catches: a suggestion for a name that is near to nothing, and a hostile name that takes long.
TEST(NearestName, IsEmptyWithoutANearCandidate) {
  EXPECT_EQ(nearest_name("", kKnown), "");
  EXPECT_EQ(nearest_name("gearbox", kKnown), "");
  EXPECT_EQ(nearest_name("perio", std::array<std::string_view, 1>{"xxxio"}), "");
  EXPECT_EQ(nearest_name("perxx", std::array<std::string_view, 1>{"perio"}), "perio");
  EXPECT_EQ(nearest_name(std::string(65, 'a'), std::vector{std::string(65, 'a')}), "");
  EXPECT_EQ(nearest_name("any", std::vector<std::string>()), "");
  EXPECT_EQ(nearest_name("xy", std::array<std::string_view, 2>{"im", "dc"}), "");
  EXPECT_EQ(nearest_name("ac", std::array<std::string_view, 2>{"im", "dc"}), "dc");
}

// Catches: a refusal that suggests nothing where it could, and a list that lacks a candidate.
TEST(NearestName, AdviceSuggestsOneNameOrListsAll) {
  EXPECT_EQ(did_you_mean("chanel", kKnown), "; did you mean \"channel\"?");
  EXPECT_EQ(did_you_mean("gearbox", kKnown), "");
  EXPECT_EQ(advice("chanel", kKnown), "; did you mean \"channel\"?");
  EXPECT_EQ(advice("gearbox", kKnown),
            "; known here: period_us, channel, stator_inductance_h, rotor_inductance_h");
  EXPECT_EQ(advice("gearbox", std::vector<std::string>()), "");
}

}  // namespace
}  // namespace drivebench::nearest_name_test
