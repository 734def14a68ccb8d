#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <string>

#include "tests/clients/regression/check_on_course.hpp"

namespace drivebench::regression::checks_test {
namespace {

/// From 0 to 10 within the ticks 10 to 20, at 12 from 21 to 30, then 10.
double step_with_overshoot(std::uint64_t tick) {
  if (tick <= 10) return 0.0;
  if (tick <= 20) return static_cast<double>(tick - 10);
  return tick <= 30 ? 12.0 : 10.0;
}

// Catches: a limit on the wrong side, a sign lost by `abs`, the place of the worst value.
TEST(Checks, BoundsNameTheWorstValueAndItsTime) {
  const Course course{.speed = [](std::uint64_t tick) { return tick == 40 ? -7.0 : tick == 50 ? 6.0 : 1.0; }};
  const Finding both = found(speed_check("bounds", "abs = 6.5"), course);
  EXPECT_FALSE(both.passed);
  EXPECT_EQ(both.measured, -7.0);
  EXPECT_EQ(both.limit, -6.5);
  EXPECT_EQ(both.at_s, 0.040);
  EXPECT_TRUE(found(speed_check("bounds", "max = 6.0"), course).passed);
  EXPECT_FALSE(found(speed_check("bounds", "max = 5.9"), course).passed);
  EXPECT_FALSE(found(speed_check("bounds", "min = -6.9"), course).passed);
  EXPECT_TRUE(found(speed_check("bounds", "min = -7.0\nmax = 6"), course).passed);
}

// Catches: a window that is one tick too long or too short at either end.
TEST(Checks, AWindowHoldsBothOfItsEnds) {
  const Course course{.speed = [](std::uint64_t tick) { return tick == 20 || tick == 30 ? 5.0 : 0.0; }};
  EXPECT_FALSE(found(speed_check("bounds", "max = 1\nfrom_s = 0.020\nto_s = 0.025"), course).passed);
  EXPECT_FALSE(found(speed_check("bounds", "max = 1\nfrom_s = 0.025\nto_s = 0.030"), course).passed);
  EXPECT_TRUE(found(speed_check("bounds", "max = 1\nfrom_s = 0.021\nto_s = 0.029"), course).passed);
}

// Catches: a check that passes because it never looked.
TEST(Checks, ACheckThatNeverAppliedFails) {
  const Finding trigger = found(speed_check("bounds", "max = 1\nafter = \"speed_rad_s > 99\""), {});
  EXPECT_FALSE(trigger.passed);
  EXPECT_FALSE(trigger.applied);
  EXPECT_EQ(trigger.sentence, "never applied: \"speed_rad_s > 99\" never held");
  const Finding window =
      found(speed_check("bounds", "max = 1\nafter = \"tick >= 90\"\nfrom_s = 0.05\nto_s = 0.06"), {});
  EXPECT_FALSE(window.passed);
  EXPECT_FALSE(window.applied);
}

// Catches: a window after a trigger that counts from tick 0.
TEST(Checks, AWindowAfterATriggerCountsFromIt) {
  const Course course{.speed = step_with_overshoot};
  const Finding finding = found(
      speed_check("bounds", "max = 11\nafter = \"speed_rad_s >= 10\"\nfrom_s = 0.011\nto_s = 0.02"), course);
  EXPECT_TRUE(finding.passed) << finding.sentence;
  EXPECT_EQ(finding.from_s, 0.031);
  EXPECT_EQ(finding.to_s, 0.040);
}

// Catches: a NaN, which is neither above nor below a limit, taken for a good value.
TEST(Checks, AValueThatIsNoNumberFails) {
  const Course course{
      .speed = [](std::uint64_t tick) { return tick == 7 ? std::numeric_limits<double>::quiet_NaN() : 0.0; }};
  for (const char* check : {"bounds", "ripple", "rms"}) {
    const Finding finding = found(speed_check(check, "max = 1"), course);
    EXPECT_FALSE(finding.passed) << check;
    EXPECT_EQ(finding.at_s, 0.007);
  }
}

// Catches: a settling time to the first entry of the band, or a signal that leaves it again at the end.
TEST(Checks, SettlingTimeIsToTheLastEntryOfTheBand) {
  const Course course{.speed = step_with_overshoot};
  const Finding settled = found(speed_check("settles", "value = 10\nband = 1\nwithin_s = 0.031"), course);
  EXPECT_TRUE(settled.passed);
  EXPECT_DOUBLE_EQ(settled.measured, 0.031);
  EXPECT_FALSE(found(speed_check("settles", "value = 10\nband = 1\nwithin_s = 0.030"), course).passed);
  EXPECT_TRUE(found(speed_check("settles", "value = 10\nband = 2\nwithin_s = 0.018"), course).passed);
  const Course leaves{.speed = [](std::uint64_t tick) { return tick == 100 ? 0.0 : 10.0; }};
  const Finding never = found(speed_check("settles", "value = 10\nband = 1\nwithin_s = 1"), leaves);
  EXPECT_FALSE(never.passed);
  EXPECT_NE(never.sentence.find("never settled"), std::string::npos);
}

// Catches: an overshoot in the unit of the signal, or of a step downwards taken as none.
TEST(Checks, OvershootAndRiseTimeAreThoseOfTheStep) {
  const Course up{.speed = step_with_overshoot};
  const Course down{.speed = [](std::uint64_t tick) { return 100.0 - 2.0 * step_with_overshoot(tick); }};
  const Finding overshoot = found(speed_check("overshoot", "value = 10\nmax_percent = 19.9"), up);
  EXPECT_FALSE(overshoot.passed);
  EXPECT_NEAR(overshoot.measured, 20.0, 1e-9);
  EXPECT_EQ(overshoot.at_s, 0.021);
  EXPECT_TRUE(found(speed_check("overshoot", "value = 80\nmax_percent = 20.1"), down).passed);
  EXPECT_FALSE(found(speed_check("overshoot", "value = 80\nmax_percent = 19.9"), down).passed);
  EXPECT_FALSE(found(speed_check("overshoot", "value = 0\nmax_percent = 50"), up).passed);  // no step
  EXPECT_TRUE(found(speed_check("rise_time", "value = 10\nmax_s = 0.008"), up).passed);
  EXPECT_FALSE(found(speed_check("rise_time", "value = 10\nmax_s = 0.007"), up).passed);
  EXPECT_FALSE(found(speed_check("rise_time", "value = 20\nmax_s = 9"), up).passed);  // never there
}

// Catches: an error without its sign's meaning, a mean over the wrong samples, a ripple of one side.
TEST(Checks, MeansRmsAndRipple) {
  const Course wave{.speed = [](std::uint64_t tick) { return tick % 2 == 0 ? 3.0 : -1.0; }};
  const std::string window = "\nfrom_s = 0.001\nto_s = 0.1";
  const Finding mean = found(speed_check("steady_state", "value = 2\nmax_error = 0.9" + window), wave);
  EXPECT_FALSE(mean.passed);
  EXPECT_DOUBLE_EQ(mean.measured, -1.0);
  EXPECT_TRUE(found(speed_check("steady_state", "value = 2\nmax_error = 1.0" + window), wave).passed);
  EXPECT_DOUBLE_EQ(found(speed_check("ripple", "max = 3.9"), wave).measured, 4.0);
  const Finding rms = found(speed_check("rms", "max = 2.2" + window), wave);
  EXPECT_FALSE(rms.passed);
  EXPECT_DOUBLE_EQ(rms.measured, std::sqrt(5.0));
  EXPECT_FALSE(found(speed_check("rms", "min = 2.3" + window), wave).passed);
}

// Catches: always and never exchanged, or `eventually` that wants every sample.
TEST(Checks, ConditionsHoldAlwaysNeverOrEventually) {
  const Course course{.speed = step_with_overshoot};
  const auto of = [&](const std::string& kind, const std::string& keys) {
    return found("kind = \"" + kind + "\"\n" + keys, course);
  };
  EXPECT_TRUE(of("always", "condition = \"speed_rad_s <= 12\"").passed);
  const Finding always = of("always", "condition = \"speed_rad_s < 12\"");
  EXPECT_FALSE(always.passed);
  EXPECT_EQ(always.measured, 10.0);
  EXPECT_EQ(always.at_s, 0.021);
  EXPECT_TRUE(of("never", "condition = \"speed_rad_s > 12\"").passed);
  EXPECT_FALSE(of("never", "condition = \"speed_rad_s >= 12\"").passed);
  EXPECT_TRUE(of("eventually", "condition = \"speed_rad_s == 12\"").passed);
  EXPECT_FALSE(of("eventually", "condition = \"speed_rad_s == 12\"\nto_s = 0.020").passed);
}

// Catches: a reaction counted from tick 0, or one tick too late or early.
TEST(Checks, AReactionIsCountedFromItsTrigger) {
  const Course course{.speed = [](std::uint64_t tick) { return tick >= 43 ? 0.0 : 9.0; },
                      .faults = [](std::uint64_t tick) { return std::uint64_t{tick >= 40 ? 256U : 0U}; }};
  const std::string reaction =
      "kind = \"reaction\"\nafter = \"faults & 256 != 0\"\ncondition = \"speed_rad_s == 0\"\n";
  EXPECT_TRUE(found(reaction + "within_ticks = 3", course).passed);
  const Finding late = found(reaction + "within_ticks = 2", course);
  EXPECT_FALSE(late.passed);
  EXPECT_EQ(late.measured, 3.0);
  EXPECT_NE(problem_of_check("kind = \"reaction\"\ncondition = \"state == 4\"\nwithin_ticks = 2")
                .find("after is missing"),
            std::string::npos);
}

// Catches: ticks counted in the place of rises, and a count without a limit that passes.
TEST(Checks, FaultsAreCountedByTheirRises) {
  const Course twice{.faults = [](std::uint64_t tick) {
    return std::uint64_t{(tick >= 10 && tick < 20) || tick >= 50 ? 256U : 0U};
  }};
  EXPECT_FALSE(found("kind = \"fault_count\"\nfault = \"trip\"", twice).passed);
  EXPECT_EQ(found("kind = \"fault_count\"\nfault = \"trip\"", twice).measured, 2.0);
  EXPECT_TRUE(found("kind = \"fault_count\"\nfault = \"trip\"\nmax = 2", twice).passed);
  EXPECT_FALSE(found("kind = \"fault_count\"\nfault = \"trip\"\nmin = 3", twice).passed);
  EXPECT_TRUE(found("kind = \"fault_count\"\nfault = \"trip\"\nmin = 2", twice).passed);
  EXPECT_TRUE(found("kind = \"fault_count\"\nfault = \"trip\"", {}).passed);
}

// Catches: a golden run compared by row and not by tick, a relative room without its size, a missing column,
// a window that the golden run does not reach and that passes all the same.
TEST(Checks, ATubeFollowsTheGoldenRunTickByTick) {
  const std::string file = (std::filesystem::temp_directory_path() / "drivebench-golden.csv").string();
  {
    std::ofstream out(file);
    out << "tick,time_s,i_a_a [A],speed_rad_s [rad/s]\n";
    for (int tick = 10; tick <= 100; ++tick)
      out << tick << "," << tick * kPeriod_s << ",9," << step_with_overshoot(static_cast<std::uint64_t>(tick))
          << "\n";
  }
  const Course same{.speed = step_with_overshoot};
  const Course off{
      .speed = [](std::uint64_t tick) { return step_with_overshoot(tick) + (tick == 25 ? 0.5 : 0.0); }};
  const std::string golden = "golden = \"" + file + "\"\n";
  EXPECT_TRUE(found(speed_check("tube", golden + "abs = 0.0"), same).passed);
  const Finding far = found(speed_check("tube", golden + "abs = 0.4"), off);
  EXPECT_FALSE(far.passed);
  EXPECT_EQ(far.at_s, 0.025);
  EXPECT_TRUE(found(speed_check("tube", golden + "rel = 0.05"), off).passed);
  EXPECT_TRUE(found(speed_check("tube", golden + "abs = 0.0"), same, 120).passed);
  EXPECT_TRUE(found(speed_check("tube", golden + "abs = 0.0\nfrom_s = 0.01\nto_s = 0.1"), same, 120).passed);
  EXPECT_FALSE(found(speed_check("tube", golden + "abs = 0.0\nto_s = 0.11"), same, 120).passed);
  EXPECT_EQ(found(speed_check("tube", golden + "abs = 0.0\nfrom_s = 0.005"), same).sentence,
            "the golden run goes from 0.01 s to 0.1 s only");
  EXPECT_NE(problem_of_check("kind = \"tube\"\nsignal = \"torque_nm\"\nabs = 1\n" + golden)
                .find("has no column torque_nm"),
            std::string::npos);
  std::filesystem::remove(file);
}

/// A run of the signal speed_rad_s over these ticks, as a file until the end.
class GoldenFile {
 public:
  GoldenFile(int first, int last, const std::function<double(std::uint64_t)>& speed) {
    std::ofstream out(path_);
    out << "tick,time_s,speed_rad_s [rad/s]\n";
    for (int tick = first; tick <= last; ++tick)
      out << tick << "," << tick * kPeriod_s << "," << speed(static_cast<std::uint64_t>(tick)) << "\n";
  }
  GoldenFile(const GoldenFile&) = delete;
  GoldenFile& operator=(const GoldenFile&) = delete;
  ~GoldenFile() { std::filesystem::remove(path_); }
  std::string key() const { return "golden = \"" + path_.string() + "\"\n"; }

 private:
  std::filesystem::path path_ = std::filesystem::temp_directory_path() / "drivebench-golden-tube.csv";
};

// Catches: a tube that is open below or, where the golden value is negative, closed; ticks after the last of
// the golden run held against it; a golden run of other times that passes, as nothing is compared.
TEST(Checks, ATubeHasTwoSidesAndTwoEnds) {
  const auto minus_ten = [](std::uint64_t) { return -10.0; };
  const Course below{.speed = [](std::uint64_t tick) { return tick == 25 ? -10.5 : -10.0; }};
  const Course leaves_later{.speed = [](std::uint64_t tick) { return tick > 60 ? 0.0 : -10.0; }};
  {
    const GoldenFile golden(0, 60, minus_ten);
    EXPECT_EQ(found(speed_check("tube", golden.key() + "abs = 0.4"), below).at_s, 0.025);
    EXPECT_TRUE(found(speed_check("tube", golden.key() + "rel = 0.06"), below).passed);
    EXPECT_FALSE(found(speed_check("tube", golden.key() + "rel = 0.04"), below).passed);
    EXPECT_TRUE(found(speed_check("tube", golden.key() + "abs = 0.0"), leaves_later).passed);
  }
  const GoldenFile later(200, 300, minus_ten);
  const Finding never = found(speed_check("tube", later.key() + "abs = 0.0"), below);
  EXPECT_FALSE(never.passed);
  EXPECT_EQ(never.sentence, "never applied: the golden run has no tick of the window");
}

// Catches: a mistake in a case file that is taken for a check.
TEST(Checks, MistakesAreRefusedWithKeyAndRule) {
  const auto has = [](const std::string& keys, std::string_view part) {
    const std::string problem = problem_of_check(keys);
    EXPECT_NE(problem.find(part), std::string::npos) << problem;
  };
  has("kind = \"bound\"",
      "case.toml:1: check[0].kind is \"bound\", no kind of check; did you mean \"bounds\"?");
  has(speed_check("bounds", "maxi = 1"), "check[0].maxi is no key here; did you mean \"max\"?");
  has(speed_check("bounds", ""), "needs min, max or both, or else abs");
  has(speed_check("bounds", "min = 2\nmax = 1"), "has a min above its max");
  has(speed_check("bounds", "max = 1\nfrom_s = 2\nto_s = 1"), "to_s is 1 but must not lie before from_s, 2");
  has(speed_check("settles", "value = 1\nband = -1\nwithin_s = 1"), "band is -1 but must be at least 0");
  has("kind = \"never\"\ncondition = \"speed > 1\"", "did you mean 'speed_rad_s'?");
  has("kind = \"bounds\"\nsignal = \"speed\"\nmax = 1",
      "no signal of a bench; did you mean \"speed_rad_s\"?");
  std::string problem;
  const auto spec = spec_of("kind = \"fault_count\"\nfault = \"tripp\"", problem);
  ASSERT_TRUE(spec.has_value());
  EXPECT_EQ(problem_on_bench(*spec, facts_to(100)),
            "fault is \"tripp\", but the bench has no such fault; did you mean \"trip\"?");
  const auto late = spec_of(speed_check("bounds", "max = 1\nfrom_s = 0.2"), problem);
  ASSERT_TRUE(late.has_value());
  EXPECT_EQ(problem_on_bench(*late, facts_to(100)), "from_s is 0.2 but the case ends at 0.1 s");
}

}  // namespace
}  // namespace drivebench::regression::checks_test
