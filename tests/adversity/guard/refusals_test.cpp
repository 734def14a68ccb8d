// The tick refuses an input without a sentence: sentences are made outside of the tick. Runs under the
// preloaded guard, like guard_test.cpp.
#include <gtest/gtest.h>

#include <filesystem>
#include <span>

#include "plant/parameters/parameters.hpp"
#include "tests/adversity/guard/guarded.hpp"

namespace drivebench::refusals_test {
namespace {

/// Submits writes, ramps and faults that break a rule to the second axis of busy_bench(), whose dry friction
/// may not exceed its static friction. Returns how many of them the ticks refuse.
std::uint64_t refused_on_the_way(Bench& bench) {
  const AxisParameters& p = bench.axis(1).parameters();
  const auto submit = [&bench](const Action& action, Tick later = 0) noexcept {
    bench.submit({.tick = bench.tick() + later, .axis = 1, .owner = 0, .action = action});
  };
  const std::uint64_t before = bench.sample(1).refused_commands;
  submit(write_of(p, "mechanics.static_friction_nm", 0.001));
  submit(write_of(p, "mechanics.static_friction_nm", 0.001), 1);
  submit(write_of(p, "mechanics.static_friction_nm", -1.0), 1);
  submit(write_of(p, "mechanics.coulomb_friction_nm", 0.03, 40), 1);
  submit(write_of(p, "machine.rotor_resistance_ohm", 4.0, 60), 1);
  submit(fault_of("open_phase", 2.5), 1);
  submit(fault_of("demagnetisation", 7.0), 1);
  submit(fault_of("bus_sag", -1e300), 1);
  for (Tick n = 0; n < kBatch; ++n)
    bench.step();
  return bench.sample(1).refused_commands - before;
}

// Catches: a refusal whose sentence is made inside the tick. RT-01.
TEST(TickGuard, RT_01_ARefusalInATickAllocatesNothing) {
  const Guard guard;
  const BenchConfig config = busy_bench();
  Tap tap(nullptr);
  Bench bench(config.setup, &tap);
  guard.begin();
  const std::uint64_t refused = refused_on_the_way(bench);
  guard.end();
  EXPECT_EQ(guard.hits(), 0u) << guard.first_hit();
  EXPECT_EQ(refused, 6u) << "two writes, one ramp and three faults";
  EXPECT_LT(bench.axis(1).parameters().mechanics.coulomb_friction_nm, 0.0201);
}

// Catches: a rule of a machine, drive or sensor whose sentence is made inside the tick. Each live parameter
// goes from one end of its range to the other and back; many of these writes break a rule.
TEST(TickGuard, RT_01_NoRuleOfAnyBenchAllocatesInATick) {
  const Guard guard;
  std::uint64_t broken = 0;
  for (const auto& entry : std::filesystem::directory_iterator(DRIVEBENCH_BENCHES)) {
    const BenchConfig config = load_config(entry.path());
    Bench bench(config.setup);
    guard.begin();
    for (std::uint32_t axis = 0; axis < bench.axis_count(); ++axis) {
      const std::span<const Parameter> rows = axis_parameters(bench.axis(axis).parameters());
      for (std::uint32_t row = 0; row < rows.size(); ++row) {
        if (!rows[row].live) continue;
        const double value = rows[row].get(bench.axis(axis).parameters());
        for (const double other : {rows[row].minimum, rows[row].maximum, value}) {
          const Refused refused =
              bench.submit({.axis = axis, .action = ParameterWrite{.row = row, .value = other}});
          broken += refused == Refused::kRuleBroken ? 1 : 0;
        }
      }
    }
    guard.end();
    ASSERT_EQ(guard.hits(), 0u) << guard.first_hit() << " in " << entry.path();
  }
  EXPECT_GT(broken, 50u);
}

}  // namespace
}  // namespace drivebench::refusals_test
