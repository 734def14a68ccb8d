// The gate level behind the C ABI.
#include <drivebench_bridge.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "tests/clients/sdk/bridge_handle.hpp"

namespace drivebench::client::bridge_test {
namespace {

// Catches: bad input that is taken, ends the program or is refused without a word; a refusal that changes the
// state.
TEST(Bridge, RefusesWhatCannotBe) {
  Bridge bridge;
  bridge.align();
  ASSERT_EQ(bridge.run(777 * kMicro), DRIVEBENCH_OK);
  const std::vector<std::byte> before = bridge.save();

  const auto refuses = [&](int code, int expected, const std::string& sentence) {
    EXPECT_EQ(code, expected) << sentence;
    EXPECT_EQ(bridge.error(), sentence);
  };
  refuses(bridge.run(776 * kMicro), DRIVEBENCH_OUT_OF_RANGE,
          "until_ps is 776000000 but time is at 777000000 already and does not go back");
  refuses(bridge.run(std::numeric_limits<std::uint64_t>::max()), DRIVEBENCH_OUT_OF_RANGE,
          "until_ps is 18446744073709551615 but must be at most 9000000000000000000");
  drivebench_bridge_edge edge;
  std::int32_t found = 7;
  refuses(drivebench_bridge_next_edge(bridge.handle, 1, &edge, &found), DRIVEBENCH_OUT_OF_RANGE,
          "limit_ps is 1 but time is at 777000000 already and does not go back");
  EXPECT_EQ(found, 0);
  refuses(bridge.set(3, leg_at(DRIVEBENCH_LEG_OPEN)), DRIVEBENCH_OUT_OF_RANGE,
          "leg is 3 but the machine has legs 0 to 2");
  refuses(bridge.set(1, leg_at(6)), DRIVEBENCH_OUT_OF_RANGE, "leg 1: mode is 6 but must be 0 to 5");
  refuses(bridge.set(1, leg_at(DRIVEBENCH_LEG_PWM, 0, 0, 0, 2)), DRIVEBENCH_OUT_OF_RANGE,
          "leg 1: centred is 2 but must be 0 or 1");
  refuses(bridge.set(1, leg_at(DRIVEBENCH_LEG_PWM, 99'999)), DRIVEBENCH_OUT_OF_RANGE,
          "leg 1: period_ps is 99999 but must be 100000 to 1000000000000 (100 ns to 1 s)");
  refuses(bridge.set(1, leg_at(DRIVEBENCH_LEG_PWM, kPeriod, kPeriod + 1)), DRIVEBENCH_OUT_OF_RANGE,
          "leg 1: compare_ps is 20000001 but must be within the period, 0 to 20000000");
  refuses(bridge.set(0, leg_at(DRIVEBENCH_LEG_LOW, 0, 0, 1'000'000'001)), DRIVEBENCH_OUT_OF_RANGE,
          "leg 0: dead_ps is 1000000001 but must be at most 1000000000 (1 ms)");
  refuses(drivebench_bridge_set(bridge.handle, 0, nullptr), DRIVEBENCH_BAD_ARGUMENT,
          "setting is a null pointer");
  std::size_t count = 0;
  refuses(drivebench_bridge_run(bridge.handle, 800 * kMicro, nullptr, 4, &count, nullptr),
          DRIVEBENCH_BAD_ARGUMENT, "edges is a null pointer");
  EXPECT_EQ(drivebench_bridge_set_load(bridge.handle, std::nan("")), DRIVEBENCH_NOT_FINITE);
  EXPECT_EQ(drivebench_bridge_inject(bridge.handle, "open_phse", 1.0), DRIVEBENCH_UNKNOWN_FAULT);
  EXPECT_NE(bridge.error().find("open_phase"), std::string::npos);
  refuses(drivebench_bridge_restore(bridge.handle, before.data(), 100), DRIVEBENCH_MALFORMED,
          "state is shorter than a state of a bridge");
  for (const std::size_t place : {0UL, 8UL, 500UL, before.size() - 1}) {
    std::vector<std::byte> damaged = before;
    damaged[place] ^= std::byte{1};
    EXPECT_EQ(drivebench_bridge_restore(bridge.handle, damaged.data(), damaged.size()), DRIVEBENCH_MALFORMED)
        << place;
  }
  EXPECT_EQ(bridge.save(), before);
  EXPECT_EQ(drivebench_bridge_run(nullptr, 0, nullptr, 0, nullptr, nullptr), DRIVEBENCH_BAD_ARGUMENT);
}

// Catches: a bench without gates, another library or a link that is taken for one with gates in process.
TEST(Bridge, OpensOnlyWhatHasGates) {
  drivebench_bridge* bridge = nullptr;
  EXPECT_EQ(drivebench_bridge_open("tcp:localhost:7300", 0, &bridge), DRIVEBENCH_NOT_AVAILABLE);
  EXPECT_STREQ(
      drivebench_bridge_error(nullptr),
      "the gate level works in process and through shared memory: the address must be inproc:BENCH or "
      "shm:PATH, not tcp:localhost:7300");
  EXPECT_EQ(drivebench_bridge_open("inproc:" DRIVEBENCH_CONFIGS "/benches/servo.toml", 0, &bridge),
            DRIVEBENCH_WRONG_DRIVE);
  EXPECT_EQ(drivebench_bridge_open(kEsc.c_str(), 1, &bridge), DRIVEBENCH_UNKNOWN_AXIS);
  EXPECT_EQ(drivebench_bridge_open("inproc:no-such-bench", 0, &bridge), DRIVEBENCH_NO_BENCH);
  EXPECT_EQ(drivebench_bridge_open_abi(kEsc.c_str(), 0, DRIVEBENCH_ABI + 1, sizeof(drivebench_bridge_state),
                                       sizeof(drivebench_bridge_means), &bridge),
            DRIVEBENCH_OTHER_ABI);
  EXPECT_EQ(bridge, nullptr);
}

// Catches: a run that goes beyond the edge that fills its room, a look ahead that differs from what comes or
// that moves time.
TEST(Bridge, GoesToTheNextEvent) {
  Bridge bridge;
  bridge.align();
  std::uint64_t now_ps = 0;
  int edges = 0;
  while (now_ps < 5000 * kMicro) {
    drivebench_bridge_edge next{};
    std::int32_t found = 0;
    ASSERT_EQ(drivebench_bridge_next_edge(bridge.handle, 5000 * kMicro, &next, &found), DRIVEBENCH_OK);
    EXPECT_EQ(bridge.read().now_ps, now_ps);
    drivebench_bridge_edge edge{};
    std::size_t count = 0;
    ASSERT_EQ(drivebench_bridge_run(bridge.handle, 5000 * kMicro, &edge, 1, &count, &now_ps), DRIVEBENCH_OK);
    ASSERT_EQ(static_cast<std::size_t>(found), count);
    if (count == 0) break;
    ++edges;
    EXPECT_EQ(edge.at_ps, next.at_ps);
    EXPECT_EQ(edge.kind, next.kind);
    EXPECT_EQ(now_ps, edge.at_ps);
  }
  EXPECT_GT(edges, 20);
  EXPECT_EQ(now_ps, 5000 * kMicro);
}

// Catches: a run with nothing due that passes an edge, which then comes late.
TEST(Bridge, AnEdgeComesInTheRunThatPassesIt) {
  Bridge bridge;
  bridge.align();
  int edges = 0;
  for (std::uint64_t now_ps = 0; now_ps < 5000 * kMicro;) {
    const std::uint64_t before_ps = now_ps;
    std::array<drivebench_bridge_edge, 16> seen;
    std::size_t count = 0;
    ASSERT_EQ(drivebench_bridge_run(bridge.handle, before_ps + kMicro / 2, seen.data(), seen.size(), &count,
                                    &now_ps),
              DRIVEBENCH_OK);
    for (std::size_t n = 0; n < count; ++n)
      EXPECT_GE(seen[n].at_ps, before_ps);
    edges += static_cast<int>(count);
  }
  EXPECT_GT(edges, 20);
}

// Catches: a mean of another interval than that since the mark, an energy that does not belong to it.
TEST(Bridge, MeansCountFromTheMark) {
  Bridge bridge;
  bridge.align(0.25);
  ASSERT_EQ(bridge.run(300'000 * kMicro + 7), DRIVEBENCH_OK);
  ASSERT_EQ(drivebench_bridge_mark(bridge.handle), DRIVEBENCH_OK);
  drivebench_bridge_means means;
  ASSERT_EQ(drivebench_bridge_mean(bridge.handle, &means), DRIVEBENCH_OK);
  EXPECT_EQ(means.time_s, 0.0);
  EXPECT_EQ(means.current_a[1], 0.0);
  ASSERT_EQ(bridge.run(300'000 * kMicro + 7 + 50 * kPeriod), DRIVEBENCH_OK);
  ASSERT_EQ(drivebench_bridge_mean(bridge.handle, &means), DRIVEBENCH_OK);
  EXPECT_EQ(means.since_ps, 300'000 * kMicro + 7);
  EXPECT_DOUBLE_EQ(means.time_s, 1e-3);
  EXPECT_NEAR(means.current_a[0] + means.current_a[1] + means.current_a[2], 0.0, 1e-9);
  // the battery: 14.8 V behind 30 mohm, its capacitor as full at the start of the 50 periods as at their
  // end; a step of at most 6.7 us has the link as it was at its start, which falls by up to 0.15 V in 4.8 us
  EXPECT_NEAR(means.bus_v, 14.8 - 0.03 * means.link_a, 5e-3);
  // the lower diode carries the current in the dead time: the leg is high for 5 us less 0.2 us of 20 us,
  // while the link is up to 0.1 V above its mean
  EXPECT_NEAR(means.terminal_v[1], means.bus_v * 4.8 / 20.0, 0.1 * 4.8 / 20.0);
  EXPECT_NEAR(means.link_j, means.electrical_j, 1e-9 * means.link_j);  // ideal switches
  EXPECT_NEAR(means.link_a * means.bus_v * means.time_s, means.link_j, 0.1 / 14.6 * means.link_j);
}

// The fault line is pulled at the start of a tick of 20 us, and the break input takes 150 ns. Catches: an
// event without its time, legs that close by themselves, a clear that does nothing.
TEST(Bridge, TheBreakInputOpensTheLegsUntilItIsCleared) {
  Bridge bridge(kBoard);
  bridge.set(0, leg_at(DRIVEBENCH_LEG_HIGH));
  bridge.set(1, leg_at(DRIVEBENCH_LEG_LOW));
  ASSERT_EQ(bridge.run(30 * kMicro), DRIVEBENCH_OK);
  ASSERT_EQ(drivebench_bridge_inject(bridge.handle, "gate_driver_fault", 1.0), DRIVEBENCH_OK);
  std::vector<drivebench_bridge_edge> edges(4096);
  std::size_t count = 0;
  ASSERT_EQ(drivebench_bridge_run(bridge.handle, 2000 * kMicro, edges.data(), edges.size(), &count, nullptr),
            DRIVEBENCH_OK);
  edges.resize(count);
  std::vector<std::uint64_t> breaks_ps;
  for (const drivebench_bridge_edge& edge : edges) {
    if (edge.kind == DRIVEBENCH_EDGE_BREAK) breaks_ps.push_back(edge.at_ps);
  }
  EXPECT_EQ(breaks_ps, std::vector<std::uint64_t>{40'150'000});
  EXPECT_EQ(bridge.read().current_a[0], 0.0);
  ASSERT_EQ(drivebench_bridge_inject(bridge.handle, "gate_driver_fault", 0.0), DRIVEBENCH_OK);
  ASSERT_EQ(bridge.run(2500 * kMicro), DRIVEBENCH_OK);
  EXPECT_EQ(bridge.read().current_a[0], 0.0);
  ASSERT_EQ(drivebench_bridge_clear(bridge.handle), DRIVEBENCH_OK);
  ASSERT_EQ(bridge.run(2550 * kMicro), DRIVEBENCH_OK);
  EXPECT_GT(bridge.read().current_a[0], 1.0);
}

// Catches: a state that another bridge of the same bench does not take, or goes on from otherwise.
TEST(Bridge, AStateGoesOnInAnotherBridge) {
  Bridge first;
  first.align(0.3);
  ASSERT_EQ(first.run(12'345'678'901), DRIVEBENCH_OK);
  const std::vector<std::byte> state = first.save();
  Bridge second;
  ASSERT_EQ(drivebench_bridge_restore(second.handle, state.data(), state.size()), DRIVEBENCH_OK)
      << second.error();
  for (Bridge* bridge : {&first, &second})
    ASSERT_EQ(bridge->run(30'000'000'000), DRIVEBENCH_OK);
  EXPECT_EQ(first.save(), second.save());
  Bridge board(kBoard);
  EXPECT_EQ(drivebench_bridge_restore(board.handle, state.data(), state.size()), DRIVEBENCH_MALFORMED);
  EXPECT_EQ(board.error(), "state is of another bench file or axis");
}

// A current that decays through the diodes of two legs dies in both at one instant. With room for one edge
// the run stops at the first, and the other one belongs to the next run, whatever is set between. Catches: a
// leg that is set at the very instant of an edge and drops it, or brings one again.
TEST(Bridge, AnEdgeAtTheInstantOfASettingComesOnce) {
  const auto deaths = [](std::uint64_t charged_ps, bool sets) {
    Bridge bridge;
    bridge.set(0, leg_at(DRIVEBENCH_LEG_HIGH));
    bridge.set(1, leg_at(DRIVEBENCH_LEG_LOW));
    EXPECT_EQ(bridge.run(charged_ps), DRIVEBENCH_OK);
    for (const std::uint32_t leg : {0U, 1U})
      bridge.set(leg, leg_at(DRIVEBENCH_LEG_OPEN));
    std::vector<std::pair<std::uint64_t, std::uint32_t>> found;
    for (std::uint64_t now_ps = 0; now_ps < 50 * kMicro;) {
      drivebench_bridge_edge edge{};
      std::size_t count = 0;
      EXPECT_EQ(drivebench_bridge_run(bridge.handle, 50 * kMicro, &edge, 1, &count, &now_ps), DRIVEBENCH_OK);
      if (count == 0 || edge.kind != DRIVEBENCH_EDGE_CURRENT_ZERO) continue;
      found.emplace_back(edge.at_ps, edge.channel);
      // c stays open, but a setting it is.
      if (sets) bridge.set(2, leg_at(DRIVEBENCH_LEG_OPEN, 0, 0, 1000 * found.size()));
    }
    return found;
  };
  for (std::uint64_t charged_ps = 3 * kMicro; charged_ps < 4 * kMicro; charged_ps += 123'457) {
    const auto alone = deaths(charged_ps, false);
    ASSERT_EQ(alone.size(), 2U);
    EXPECT_EQ(alone[0].first, alone[1].first);
    EXPECT_EQ(deaths(charged_ps, true), alone);
  }
}

/// What the bridge has as resistance of a phase, and the current after 1 ms between two legs.
double current_after_writing(Bridge& bridge, double resistance_ohm) {
  EXPECT_EQ(drivebench_bridge_set_parameter(bridge.handle, "machine.stator_resistance_ohm", resistance_ohm),
            DRIVEBENCH_OK)
      << bridge.error();
  double value = 0.0;
  EXPECT_EQ(drivebench_bridge_get_parameter(bridge.handle, "machine.stator_resistance_ohm", &value),
            DRIVEBENCH_OK);
  EXPECT_EQ(value, resistance_ohm);
  const std::uint64_t until_ps = bridge.read().now_ps + 100 * kMicro;
  EXPECT_EQ(bridge.run(until_ps), DRIVEBENCH_OK);
  return bridge.read().current_a[0];
}

// The rotor is held. Catches: a parameter that is written and not in force from that instant on, one that a
// look ahead of before lets slip, a state that is restored without it.
TEST(Bridge, AParameterIsInForceFromTheInstantOfItsWriting) {
  constexpr std::uint64_t kInstant = 33'333'333;
  Bridge at_once;
  Bridge looked;
  for (Bridge* bridge : {&at_once, &looked}) {
    bridge->align();
    ASSERT_EQ(bridge->run(kInstant), DRIVEBENCH_OK);
  }
  drivebench_bridge_edge edge;
  std::int32_t found = 0;
  ASSERT_EQ(drivebench_bridge_next_edge(looked.handle, 200 * kMicro, &edge, &found), DRIVEBENCH_OK);
  const std::vector<std::byte> before = at_once.save();
  const double changed_a = current_after_writing(at_once, 2.0);
  EXPECT_EQ(current_after_writing(looked, 2.0), changed_a);
  EXPECT_EQ(looked.save(), at_once.save());
  const std::vector<std::byte> after = at_once.save();

  ASSERT_EQ(drivebench_bridge_restore(at_once.handle, before.data(), before.size()), DRIVEBENCH_OK);
  ASSERT_EQ(at_once.run(kInstant + 100 * kMicro), DRIVEBENCH_OK);
  EXPECT_NE(at_once.read().current_a[0], changed_a);
  Bridge third;
  ASSERT_EQ(drivebench_bridge_restore(third.handle, after.data(), after.size()), DRIVEBENCH_OK);
  for (Bridge* bridge : {&third, &looked})
    ASSERT_EQ(bridge->run(5000 * kMicro), DRIVEBENCH_OK);
  EXPECT_EQ(third.save(), looked.save());
}

// Catches: a wrong name, a fixed parameter, a value beyond its limits that is taken or refused without a
// word.
TEST(Bridge, RefusesAParameterThatCannotBe) {
  Bridge bridge;
  const std::vector<std::byte> before = bridge.save();
  double value = 0.0;
  EXPECT_EQ(drivebench_bridge_set_parameter(bridge.handle, "machine.stator_resistance", 1.0),
            DRIVEBENCH_UNKNOWN_PARAMETER);
  EXPECT_EQ(bridge.error(),
            "there is no parameter 'machine.stator_resistance'; did you mean "
            "\"machine.stator_resistance_ohm\"?");
  EXPECT_EQ(drivebench_bridge_get_parameter(bridge.handle, "nothing", &value), DRIVEBENCH_UNKNOWN_PARAMETER);
  EXPECT_EQ(drivebench_bridge_set_parameter(bridge.handle, "encoder.counts_per_revolution", 400.0),
            DRIVEBENCH_READ_ONLY);
  EXPECT_EQ(drivebench_bridge_set_parameter(bridge.handle, "machine.stator_resistance_ohm", -1.0),
            DRIVEBENCH_OUT_OF_RANGE);
  EXPECT_EQ(drivebench_bridge_set_parameter(bridge.handle, "machine.stator_resistance_ohm", std::nan("")),
            DRIVEBENCH_NOT_FINITE);
  EXPECT_EQ(drivebench_bridge_set_parameter(bridge.handle, nullptr, 1.0), DRIVEBENCH_BAD_ARGUMENT);
  EXPECT_EQ(drivebench_bridge_get_parameter(bridge.handle, "bus.voltage_v", nullptr),
            DRIVEBENCH_BAD_ARGUMENT);
  EXPECT_EQ(bridge.save(), before);
}

}  // namespace
}  // namespace drivebench::client::bridge_test
