// Saved states of the gate level: what a look ahead leaves in them, and bytes that no bridge has saved.
#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <limits>
#include <span>

#include "tests/clients/sdk/bridge_handle.hpp"
#include "tests/repetitions.hpp"

namespace drivebench::client::bridge_state_test {
namespace {

constexpr std::uint64_t kMilli = 1000 * kMicro;
constexpr std::size_t kDigestAt = 16;

std::uint64_t digest_of(std::span<const std::byte> bytes) {
  std::uint64_t hash = 14695981039346656037ULL;
  for (const std::byte byte : bytes)
    hash = (hash ^ static_cast<std::uint64_t>(byte)) * 1099511628211ULL;
  return hash;
}

/// Writes the digest that fits the changed bytes. Every client can: the digest has no secret.
void sign(std::vector<std::byte>& state) {
  const std::uint64_t digest = digest_of(std::span(state).subspan(kDigestAt + 8));
  std::memcpy(state.data() + kDigestAt, &digest, sizeof digest);
}

std::uint64_t word_at(const std::vector<std::byte>& state, std::size_t at) {
  std::uint64_t word = 0;
  std::memcpy(&word, state.data() + at, sizeof word);
  return word;
}

/// A motor that turns, with a look ahead over some edges.
void drive(Bridge& bridge) {
  bridge.align(0.3);
  ASSERT_EQ(bridge.run(kMilli + 3333), DRIVEBENCH_OK);
  drivebench_bridge_edge edge;
  std::int32_t found = 0;
  ASSERT_EQ(drivebench_bridge_next_edge(bridge.handle, 2 * kMilli, &edge, &found), DRIVEBENCH_OK);
}

/// What a program may do with a restored bridge.
void use(Bridge& bridge) {
  drivebench_bridge_edge edge;
  std::int32_t found = 0;
  const std::uint64_t now_ps = bridge.read().now_ps;
  drivebench_bridge_next_edge(bridge.handle, now_ps + 100 * kMicro, &edge, &found);
  bridge.run(now_ps + 50 * kMicro);
  bridge.set(0, leg_at(DRIVEBENCH_LEG_HIGH));
  bridge.run(now_ps + 150 * kMicro);
  bridge.read();
}

// Each word of a state is replaced by what hurts most, and signed. Catches: a length that wraps, an index or
// a division that is not judged, a time from which a run never comes back, a refusal that changes something.
TEST(BridgeState, NoBytesBreakABridge) {
  Bridge source;
  drive(source);
  const std::vector<std::byte> state = source.save();
  constexpr std::array<std::uint64_t, 13> kNasty{
      0,
      1,
      3,
      7,
      0xFFFF'FFFFu,
      0x3'0000'0003u,
      1ULL << 40,
      1ULL << 59,
      1ULL << 62,
      ~0ULL,
      0xC000'0000'0000'0000u,
      std::bit_cast<std::uint64_t>(std::numeric_limits<double>::infinity()),
      std::bit_cast<std::uint64_t>(1e300)};
  Bridge bridge;
  std::size_t taken = 0;
  std::size_t refused = 0;
  for (std::size_t at = kDigestAt + 8; at + 8 <= state.size(); at += 8) {
    for (std::size_t n = 0; n < kNasty.size(); ++n) {
      const std::uint64_t word = kNasty[n];
      if (word == word_at(state, at)) continue;
      if (kSanitized && (at / 8 + n) % 7 != 0) continue;  // one or two for each word
      std::vector<std::byte> forged = state;
      std::memcpy(forged.data() + at, &word, sizeof word);
      sign(forged);
      if (drivebench_bridge_restore(bridge.handle, forged.data(), forged.size()) == DRIVEBENCH_OK) {
        ++taken;
        use(bridge);
      } else {
        ++refused;
      }
    }
  }
  EXPECT_GT(refused, repetitions(1000U));
  EXPECT_GT(taken, repetitions(1000U));  // most words may hold anything
  const std::vector<std::byte> before = bridge.save();
  std::vector<std::byte> forged = state;
  forged.resize(forged.size() - 8);
  sign(forged);
  EXPECT_EQ(drivebench_bridge_restore(bridge.handle, forged.data(), forged.size()), DRIVEBENCH_MALFORMED);
  EXPECT_EQ(bridge.save(), before);
}

// Catches: a log of edges and a way to integrate again that grow with each look, a state that can then not be
// restored.
TEST(BridgeState, LookingAheadForALongTimeLeavesNothingBehind) {
  Bridge looks;
  Bridge runs;
  for (Bridge* bridge : {&looks, &runs})
    bridge->align(0.3);
  constexpr std::uint64_t kEnd = 60 * kMilli;
  drivebench_bridge_edge edge;
  std::int32_t found = 0;
  for (std::uint64_t now_ps = 0; now_ps < kEnd;) {
    ASSERT_EQ(drivebench_bridge_next_edge(looks.handle, now_ps + 5 * kMilli, &edge, &found), DRIVEBENCH_OK);
    const std::uint64_t until_ps = std::min({kEnd, found != 0 ? edge.at_ps : kEnd, now_ps + 77 * kMicro});
    ASSERT_EQ(looks.run(until_ps), DRIVEBENCH_OK);
    now_ps = std::max(until_ps, now_ps);
    if (found != 0 && edge.at_ps == now_ps) ++now_ps;
  }
  ASSERT_EQ(runs.run(looks.read().now_ps), DRIVEBENCH_OK);
  const std::vector<std::byte> state = looks.save();
  EXPECT_EQ(state, runs.save());
  Bridge restored;
  ASSERT_EQ(drivebench_bridge_restore(restored.handle, state.data(), state.size()), DRIVEBENCH_OK)
      << restored.error();
  for (Bridge* bridge : {&restored, &runs, &looks})
    ASSERT_EQ(bridge->run(2 * kEnd), DRIVEBENCH_OK);
  EXPECT_EQ(restored.save(), runs.save());
  EXPECT_EQ(looks.save(), runs.save());
}

// The rotor turns at some thousand rad/s, and between two ticks its angle goes beyond a turn. Catches: a
// state within a tick that is refused, or that does not go on with the same bits.
TEST(BridgeState, EveryStateOfATurnCanBeRestored) {
  Bridge bridge;
  Bridge other;
  ASSERT_EQ(drivebench_bridge_set_load(bridge.handle, -2.0), DRIVEBENCH_OK);
  for (std::uint64_t now_ps = 0; now_ps < 30 * kMilli; now_ps += 7'300'001) {
    ASSERT_EQ(bridge.run(now_ps), DRIVEBENCH_OK);
    const std::vector<std::byte> state = bridge.save();
    ASSERT_EQ(drivebench_bridge_restore(other.handle, state.data(), state.size()), DRIVEBENCH_OK)
        << now_ps << ": " << other.error();
    ASSERT_EQ(other.save(), state) << now_ps;
  }
  ASSERT_EQ(bridge.run(1500 * kMilli), DRIVEBENCH_OK);
  EXPECT_GT(bridge.read().angle_rad, 7000.0);
  const std::vector<std::byte> state = bridge.save();
  EXPECT_EQ(drivebench_bridge_restore(other.handle, state.data(), state.size()), DRIVEBENCH_OK)
      << other.error();
}

// A load of 2,000 N m turns the small rotor beyond all bounds within 10 ms. Catches: a look ahead
// after which a run says what has not happened yet, a machine that diverges in silence.
TEST(BridgeState, AMachineDivergesWhenItDoesAndNotWhenItIsLookedAt) {
  Bridge looks;
  Bridge runs;
  for (Bridge* bridge : {&looks, &runs})
    ASSERT_EQ(drivebench_bridge_set_load(bridge->handle, 2e3), DRIVEBENCH_OK) << bridge->error();
  drivebench_bridge_edge edge;
  std::int32_t found = 0;
  std::uint64_t diverges_ps = 0;
  for (std::uint64_t now_ps = 50 * kMicro; diverges_ps == 0 && now_ps < 1000 * kMilli;
       now_ps += 50 * kMicro) {
    drivebench_bridge_next_edge(looks.handle, now_ps + 900 * kMilli, &edge, &found);
    const int code = runs.run(now_ps);
    ASSERT_EQ(looks.run(now_ps), code) << now_ps;
    if (code == DRIVEBENCH_LATCHED) diverges_ps = now_ps;
  }
  EXPECT_GT(diverges_ps, kMilli);
}

}  // namespace
}  // namespace drivebench::client::bridge_state_test
