#include "clients/regression/shrink/shrink.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "clients/regression/tables/key_table.hpp"
#include "clients/regression/tables/toml_text.hpp"

namespace drivebench::regression::shrink_test {
namespace {

constexpr const char* kCase = R"(
bench = "servo"
duration_s = 1.0
seed = 17
tags = ["slow"]

[dut]
preset = "p"
gains.a.b = 2.345
gains.c = 7.0

[override.axis.0.machine]
inertia_kgm2 = 3.21
poles = 13

[[step]]
at_s = 0.1
load_nm = 1.0
[[step]]
at_s = 0.3
load_nm = 0.4321
ramp_s = 0.01
[[step]]
at_s = 0.5
load_nm = 2.0
[[step]]
at_s = 0.7
load_nm = 0.77
[[step]]
at_s = 0.9
load_nm = 3.0

[[check]]
name = "first"
[[check]]
name = "second"
[[check]]
name = "third"
)";

ConfigNode parsed(const char* text) {
  ProblemList problems;
  auto table = parse_document(text, "case.toml", problems);
  problems.throw_if_any();
  return *table;
}

std::vector<double> loads_in(const ConfigNode& table) {
  std::vector<double> loads;
  if (const ConfigNode* const steps = find_child(table, "step")) {
    for (const ConfigNode& step : steps->children)
      loads.push_back(number_in(*find_child(step, "load_nm")).value());
  }
  return loads;
}

/// As a drive would that needs two loads one after the other, an inertia above 3 and half a second.
bool fails(const ConfigNode& table) {
  const ConfigNode* const checks = find_child(table, "check");
  const bool has_check = checks != nullptr && std::ranges::any_of(checks->children, [](const ConfigNode& c) {
                           return toml_text(c).find("second") != std::string::npos;
                         });
  const std::vector<double> loads = loads_in(table);
  const auto between = [&loads](double low, double high) {
    return std::ranges::any_of(loads, [=](double load) { return load > low && load < high; });
  };
  return has_check && between(0.42, 0.44) && between(0.75, 0.85) &&
         toml_text(table).find("inertia_kgm2 = 3") != std::string::npos &&
         number_in(*find_child(table, "duration_s")).value() > 0.47;
}

Shrunk shrunk(std::size_t most_runs, const StillFails& still_fails = fails) {
  return shrink(parsed(kCase), {.check = 1, .longest_s = 1.0, .most_runs = most_runs}, still_fails,
                [](const std::string&, std::size_t) {});
}

// Catches: a part that is dropped although the failure needs it, one that stays although it does not, numbers
// that lose more digits than they may, an empty table that stays.
TEST(Shrink, WhatTheFailureNeedsStaysAndTheRestGoes) {
  const Shrunk result = shrunk(300);
  EXPECT_TRUE(result.is_smallest);
  EXPECT_TRUE(fails(result.table));
  EXPECT_EQ(toml_text(result.table), R"(duration_s = 0.48
bench = "servo"

[[check]]
name = "second"

[dut]
preset = "p"

[override]

[override.axis]

[override.axis.0]

[override.axis.0.machine]
inertia_kgm2 = 3.0

[[step]]
at_s = 0.0
load_nm = 0.43

[[step]]
at_s = 0.0
load_nm = 0.8
)");
  EXPECT_LT(result.runs, 60u);
}

// Catches: a table that is run twice, a result that hangs on more than the case, runs beyond the limit.
TEST(Shrink, RunsAreBoundedAndNoTableRunsTwice) {
  std::vector<std::string> tried;
  const auto count = [&tried](const ConfigNode& table) {
    tried.push_back(toml_text(table));
    return fails(table);
  };
  const Shrunk whole = shrunk(300, count);
  EXPECT_EQ(tried.size(), whole.runs);
  std::ranges::sort(tried);
  EXPECT_EQ(std::ranges::adjacent_find(tried), tried.end());
  EXPECT_EQ(toml_text(shrunk(300).table), toml_text(whole.table));
  for (const std::size_t most : {1U, 2U, 7U, 20U}) {
    const Shrunk part = shrunk(most);
    EXPECT_EQ(part.runs, most);
    EXPECT_FALSE(part.is_smallest);
    EXPECT_TRUE(fails(part.table));
  }
}

// Catches: a search that goes on after it was stopped, or that loses what it has found.
TEST(Shrink, ASearchThatIsStoppedGivesTheSmallestTableSoFar) {
  std::size_t runs = 0;
  const auto count = [&runs](const ConfigNode& table) {
    ++runs;
    return fails(table);
  };
  const Shrunk part =
      shrink(parsed(kCase),
             {.check = 1, .longest_s = 1.0, .most_runs = 300, .is_stopped = [&] { return runs == 7; }}, count,
             [](const std::string&, std::size_t) {});
  EXPECT_EQ(part.runs, 7u);
  EXPECT_FALSE(part.is_smallest);
  EXPECT_EQ(toml_text(part.table), toml_text(shrunk(7).table));
}

// Catches: a rounder number that no double can have, which ended the search with "stod" or was tried.
TEST(Shrink, TheSmallestAndTheLargestNumbersBecomeRounder) {
  const ConfigNode extremes = parsed(R"(
bench = "servo"
[[step]]
at_s = 3.21e-310
load_nm = 1.797e308
[[check]]
name = "first"
)");
  const auto has_both = [](const ConfigNode& table) {
    const std::string text = toml_text(table);
    EXPECT_EQ(text.find("inf"), std::string::npos);
    return text.find("at_s = 3") != std::string::npos && text.find("load_nm = 1") != std::string::npos;
  };
  const Shrunk result = shrink(extremes, {.check = 0}, has_both, [](const std::string&, std::size_t) {});
  const ConfigNode& step = find_child(result.table, "step")->children.front();
  EXPECT_EQ(number_in(*find_child(step, "at_s")), 3e-310);
  EXPECT_EQ(number_in(*find_child(step, "load_nm")), 1.797e308);
}

// Catches: a length that is changed although the check judges the run as a whole, a case that cannot become
// smaller and changes all the same.
TEST(Shrink, WhatCannotBecomeSmallerStays) {
  const Shrunk result = shrink(parsed(kCase), {.check = 1}, fails, [](const std::string&, std::size_t) {});
  EXPECT_EQ(number_in(*find_child(result.table, "duration_s")), 1.0);
  const Shrunk none = shrunk(300, [](const ConfigNode&) { return false; });
  EXPECT_EQ(toml_text(none.table), toml_text(parsed(kCase)));
}

}  // namespace
}  // namespace drivebench::regression::shrink_test
