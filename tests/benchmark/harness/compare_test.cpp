#include "tests/benchmark/harness/compare.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <stdexcept>

#include "tests/benchmark/harness/report.hpp"

namespace drivebench::speed::compare_test {
namespace {

constexpr const char* kHere = "A CPU, 2 CPUs";

Row tick(double measured, double floor) {
  return {.name = "tick", .unit = "ns", .measured = measured, .floor = floor};
}

Compared compared(const Row& before, const Row& after, const char* machine = kHere) {
  return compare(as_json(kHere, {before}), as_json(machine, {after})).at(0);
}

/// Catches: a slower machine that passes for a slower program, and a slower program that its faster machine
/// hides.
TEST(BenchmarkCompare, RatiosAreComparedAndNotTheMachines) {
  EXPECT_EQ(compared(tick(400.0, 100.0), tick(800.0, 200.0)).verdict, Change::kSame);
  EXPECT_EQ(compared(tick(400.0, 100.0), tick(400.0, 50.0), "another").verdict, Change::kSlower);
  EXPECT_NEAR(compared(tick(400.0, 100.0), tick(500.0, 100.0)).change, 0.25, 1e-12);
}

/// Catches: a figure of which more is better (times real time) that is read the wrong way round.
TEST(BenchmarkCompare, MoreCanBeBetter) {
  Row before{.name = "free", .unit = "x", .measured = 150.0, .limit = Limit{Limit::Kind::kAtLeast, 100.0}};
  Row after = before;
  after.measured = 120.0;
  EXPECT_EQ(compared(before, after).verdict, Change::kSlower);
  EXPECT_EQ(compared(after, before).verdict, Change::kFaster);
}

/// Catches: noise that is called a change, a change that is called noise.
TEST(BenchmarkCompare, WhatLiesWithinTheRangeOfTheRunsIsNoise) {
  const auto runs = [](double low, double middle, double high) {
    return median_of({{tick(middle, 100.0)}, {tick(high, 100.0)}, {tick(low, 100.0)}}).at(0);
  };
  EXPECT_EQ(runs(390.0, 400.0, 480.0).measured, 400.0);
  EXPECT_EQ(compared(runs(390.0, 400.0, 480.0), runs(430.0, 450.0, 460.0)).verdict, Change::kSame);
  EXPECT_EQ(compared(runs(390.0, 400.0, 410.0), runs(430.0, 450.0, 460.0)).verdict, Change::kSlower);
  EXPECT_EQ(compared(runs(390.0, 400.0, 401.0), runs(402.0, 410.0, 420.0)).verdict, Change::kSame);  // 2.5 %
}

/// Catches: figures of a disturbed, a skipped or another machine's run that are judged, and a wrong file that
/// is read.
TEST(BenchmarkCompare, WhatCannotBeComparedIsTold) {
  Row disturbed = tick(900.0, 100.0);
  disturbed.disturbance.slowed = 0.2;
  EXPECT_EQ(compared(tick(400.0, 100.0), disturbed).reason, "after: disturbed");
  const Row memory{.name = "memory", .unit = "MiB", .measured = 25.0};
  Row more = memory;
  more.measured = 50.0;
  EXPECT_EQ(compared(memory, more).verdict, Change::kSlower);
  EXPECT_EQ(compared(memory, more, "another").reason, "no floor, another machine");
  Row skipped{.name = "memory", .note = "no server", .skipped = true};
  EXPECT_EQ(compared(skipped, memory).reason, "before: skipped");
  EXPECT_EQ(compare(as_json(kHere, {}), as_json(kHere, {memory})).at(0).reason, "not measured before");
  EXPECT_THROW(compare({{"rows", 1}}, as_json(kHere, {memory})), std::runtime_error);
}

}  // namespace
}  // namespace drivebench::speed::compare_test
