// The load profile, and the table of the parameters of section mechanics.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "plant/mechanics/shaft.hpp"
#include "plant/parameters/mechanics_rows.hpp"

namespace drivebench::load_profile_test {
namespace {

const Parameter& row_named(std::string_view name) {
  const auto rows = mechanics_rows();
  const auto found =
      std::find_if(rows.begin(), rows.end(), [name](const Parameter& r) { return r.name == name; });
  if (found == rows.end()) throw std::out_of_range(std::string(name));
  return *found;
}

std::vector<Problem> problems_of(const MechanicsParameters& p) {
  std::vector<Problem> found;
  Problems rules(found);
  add_problems(p, rules);
  return found;
}

// Catches: a profile that goes on along its last slope, starts before its first point, or is shifted in time.
TEST(LoadProfile, ItFollowsItsPointsAndHoldsTheValuesOfItsEnds) {
  MechanicsParameters p;
  EXPECT_EQ(profile_load_nm(p, 5.0), 0.0);
  p.load_profile = Curve({{0.5, 0.0}, {0.5625, 0.25}, {1.5, 0.25}, {2.0, -0.75}});
  EXPECT_EQ(profile_load_nm(p, 0.0), 0.0);
  EXPECT_EQ(profile_load_nm(p, 0.5), 0.0);
  EXPECT_NEAR(profile_load_nm(p, 0.53125), 0.125, 1e-16);
  EXPECT_EQ(profile_load_nm(p, 1.0), 0.25);
  EXPECT_NEAR(profile_load_nm(p, 1.75), -0.25, 1e-16);
  EXPECT_EQ(profile_load_nm(p, 2.0), -0.75);
  EXPECT_EQ(profile_load_nm(p, 1e6), -0.75);
}

// Catches: a curve that is written to another place than it is read from.
TEST(LoadProfile, TheTableOfCurvesReachesIt) {
  ASSERT_EQ(mechanics_curves().size(), 1u);
  const CurveParameter& curve = mechanics_curves()[0];
  EXPECT_EQ(curve.name, "mechanics.load_profile");
  EXPECT_FALSE(curve.required || curve.rising);
  AxisParameters p;
  curve.set(p, Curve({{0.0, 1.0}, {1.0, 2.0}}));
  EXPECT_EQ(curve.get(p).points().size(), 2u);
  EXPECT_EQ(profile_load_nm(p.mechanics, 0.5), 1.5);
}

// Catches: a row that reads one member and writes another, two rows for one member.
TEST(MechanicsRows, EachRowReadsWhatItWritesAndTouchesNothingElse) {
  std::set<std::string_view> seen;
  for (const Parameter& row : mechanics_rows()) {
    EXPECT_TRUE(seen.insert(row.name).second) << row.name;
    EXPECT_TRUE(row.name.starts_with("mechanics."));
    EXPECT_FALSE(row.unit.empty() || row.meaning.empty()) << row.name;
    const AxisParameters untouched;
    AxisParameters p;
    const double value = row.get(p) == row.maximum ? row.minimum : row.maximum;
    row.set(p, value);
    for (const Parameter& other : mechanics_rows())
      EXPECT_EQ(other.get(p), &other == &row ? value : other.get(untouched))
          << row.name << " / " << other.name;
  }
  EXPECT_EQ(seen.size(), 16u);  // every member of MechanicsParameters but the profile
}

// Recordings and configurations of older benches hold these four. Catches: another name, unit, range or
// liveness.
TEST(MechanicsRows, TheRowsOfTheFirstVersionStay) {
  const auto is = [](std::string_view name, std::string_view unit, double minimum, double maximum,
                     bool required) {
    const Parameter& row = row_named(name);
    EXPECT_EQ(row.unit, unit);
    EXPECT_EQ(row.minimum, minimum);
    EXPECT_EQ(row.maximum, maximum);
    EXPECT_EQ(row.required, required);
    EXPECT_TRUE(row.live);
    EXPECT_FALSE(row.integer);
  };
  is("mechanics.inertia_kgm2", "kg*m^2", 1e-12, 1e9, true);
  is("mechanics.viscous_friction_nms", "N*m*s/rad", 0.0, 1e6, false);
  is("mechanics.coulomb_friction_nm", "N*m", 0.0, 1e6, false);
  is("mechanics.static_friction_nm", "N*m", 0.0, 1e6, false);
}

// Catches: words in another order than the enumeration, a motion that cannot be written while running.
TEST(MechanicsRows, TheMotionIsAChoiceOfThreeWords) {
  const Parameter& row = row_named("mechanics.motion");
  ASSERT_EQ(row.words.size(), 3u);
  EXPECT_TRUE(row.live && row.integer);
  EXPECT_EQ(row.minimum, 0.0);
  EXPECT_EQ(row.maximum, 2.0);
  AxisParameters p;
  row.set(p, 1.0);
  EXPECT_EQ(row.words[1], "locked");
  EXPECT_EQ(p.mechanics.motion, ShaftMotion::kLocked);
  row.set(p, 2.0);
  EXPECT_EQ(row.words[2], "imposed");
  EXPECT_EQ(p.mechanics.motion, ShaftMotion::kImposed);
}

// The state of a running shaft fits one ratio and one kind of shaft. Catches: a gear that jumps while it
// turns.
TEST(MechanicsRows, ParametersThatShapeTheStateAreNotLive) {
  for (const std::string_view name : {"mechanics.gear_ratio", "mechanics.shaft_stiffness_nm",
                                      "mechanics.backlash_rad", "mechanics.screw_lead_m"}) {
    EXPECT_FALSE(row_named(name).live) << name;
  }
}

// Catches: rules between the values that are not checked, and rules for values that are right.
TEST(MechanicsRows, AProblemNamesTheValueThatDoesNotFitTheOthers) {
  const auto named = [](const MechanicsParameters& p) {
    std::set<std::string> fields;
    for (const Problem& problem : problems_of(p)) {
      fields.insert(problem.field);
      EXPECT_EQ(problem.rule.substr(0, 3), "is ");
    }
    return fields;
  };
  using Fields = std::set<std::string>;
  MechanicsParameters p{.inertia_kgm2 = 1e-4};
  EXPECT_EQ(named(p), Fields{});
  p.coulomb_friction_nm = 0.02;
  p.static_friction_nm = 0.0199;
  p.shaft_damping_nms = 0.1;
  p.backlash_rad = 0.01;
  EXPECT_EQ(named(p), (Fields{"mechanics.static_friction_nm", "mechanics.shaft_damping_nms",
                              "mechanics.backlash_rad"}));
  p.static_friction_nm = 0.02;
  p.shaft_stiffness_nm = 10.0;
  EXPECT_EQ(named(p), Fields{"mechanics.load_inertia_kgm2"});
  p.load_inertia_kgm2 = 1e-4;
  EXPECT_EQ(named(p), Fields{});
}

}  // namespace
}  // namespace drivebench::load_profile_test
