// Commands with edges of the legs: rules, state and safe action.
#include <gtest/gtest.h>

#include "tests/server/bench/servo_bench.hpp"

namespace drivebench::bench_edges_test {
namespace {

constexpr Owner kOwner = 7;
using enum LegLevel;

BenchSetup switched_setup() {
  BenchSetup setup = servo_setup(1);
  setup.axes[0].parameters.drive.kind = DriveKind::kSwitched;
  setup.axes[0].parameters.drive.amplifier.voltage_limit_v = 40.0;
  setup.axes[0].parameters.drive.inverter.dead_time_s = 1e-6;
  return setup;
}

Command edges_in_answer_to(Tick tick, std::uint32_t rise_ns) {
  Command command{.answers = tick, .phases = {.gates = Gates::kEdges}};
  command.phases.edges[0] = {{LegEdge(0, kLow), LegEdge(rise_ns, kHigh)}};
  command.phases.edges[1] = {{LegEdge(0, kHigh), LegEdge(60'000, kLow), LegEdge(60'001, kOff)}};
  return command;
}

Refused submit_edges(Bench& bench, const Command& command) {
  return bench.submit({.axis = 0, .owner = kOwner, .action = command});
}

// Catches: a list that other drives would pass over, edges of another tick, a list that the pattern would
// sort.
TEST(BenchEdges, OnlyASwitchedInverterTakesListsInOrderWithinThePeriod) {
  Bench amplifier = owned_bench(servo_setup(), kOwner);
  EXPECT_EQ(submit_edges(amplifier, edges_in_answer_to(amplifier.tick(), 1)), Refused::kWrongDrive);
  Bench bench = owned_bench(switched_setup(), kOwner);
  const auto judged = [&bench](LegEdge first, LegEdge second, LegEdge third = {}) {
    Command command = edges_in_answer_to(bench.tick(), 1);
    command.phases.edges[2] = {{first, second, third}};
    return judge(command, kOwner, bench.command_view(0));
  };
  EXPECT_EQ(judged({0, kLow}, {124'999, kHigh}), Refused::kNot);
  EXPECT_EQ(judged({0, kLow}, {125'000, kHigh}), Refused::kBeyondDrive);
  EXPECT_EQ(judged({7, kLow}, {7, kHigh}), Refused::kBeyondDrive);
  EXPECT_EQ(judged({7, kLow}, {6, kHigh}), Refused::kBeyondDrive);
  EXPECT_EQ(judged({7, kLow}, {}, {8, kHigh}), Refused::kBeyondDrive);
}

// Catches: edges that hash, saved state or the tick after next do not have; one nanosecond is another run.
TEST(BenchEdges, TheStateHasEveryEdge) {
  Bench bench = owned_bench(switched_setup(), kOwner);
  Bench other = owned_bench(switched_setup(), kOwner);
  for (int n = 0; n < 40; ++n) {
    ASSERT_EQ(bench.state_hash(), other.state_hash());
    const auto rise_ns = static_cast<std::uint32_t>(20'000 + 100 * n);
    ASSERT_EQ(submit_edges(bench, edges_in_answer_to(bench.tick(), rise_ns)), Refused::kNot);
    ASSERT_EQ(submit_edges(other, edges_in_answer_to(other.tick(), rise_ns)), Refused::kNot);
    bench.step();
    other.step();
  }
  EXPECT_GT(std::abs(bench.sample(0).true_i_a_a), 0.01);
  ASSERT_EQ(submit_edges(bench, edges_in_answer_to(bench.tick(), 30'000)), Refused::kNot);
  ASSERT_EQ(submit_edges(other, edges_in_answer_to(other.tick(), 30'001)), Refused::kNot);
  EXPECT_NE(bench.state_hash(), other.state_hash());
  const std::vector<std::byte> saved = bench.save();
  ASSERT_TRUE(other.restore(saved));
  EXPECT_EQ(bench.state_hash(), other.state_hash());
  for (int n = 0; n < 3; ++n) {
    bench.step();
    other.step();
  }
  EXPECT_EQ(bench.state_hash(), other.state_hash());
}

// Catches: a quick stop that turns edges like a vector, a hold that forgets them.
TEST(BenchEdges, HoldRepeatsTheListAndQuickStopLetsTheLegsGo) {
  LastCommands last;
  follow(last, edges_in_answer_to(0, 5).phases, Connection::kTwoPhase, true);
  const PhaseCommand held = act_safely(last, SafeAction::kHold, false, Connection::kTwoPhase, 100);
  EXPECT_EQ(held.gates, Gates::kEdges);
  EXPECT_EQ(held.edges[0][1].offset_ns(), 5u);
  EXPECT_EQ(act_safely(last, SafeAction::kQuickStop, false, Connection::kTwoPhase, 100).gates, Gates::kOff);
}

}  // namespace
}  // namespace drivebench::bench_edges_test
