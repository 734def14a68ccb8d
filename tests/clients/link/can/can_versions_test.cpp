// The two sets of default identifiers between a link and a bench.
#include "clients/link/can/can_versions.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <deque>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "clients/link/can/can_link.hpp"
#include "tests/clients/link/can/fake_can_bench.hpp"

namespace drivebench::link::can_versions_test {
namespace {

constexpr CanLinkOptions kQuick = {.deadline = std::chrono::milliseconds(30)};

CanAddress address_with(bool fd, can::IdSet set) {
  CanAddress address;
  address.node = kNode;
  address.profile.fd = fd;
  address.profile.choose_ids(set, false);
  return address;
}

/// The error of a link that connects to a bus with these frames and nothing else.
std::string failure_with(std::deque<can::Frame> frames, const CanAddress& address) {
  auto silent = std::make_unique<FakeCanBench>(address.profile, kNode);
  silent->coming = std::move(frames);
  try {
    CanLink(std::move(silent), address, "can:test", kQuick);
  } catch (const ConnectError& error) {
    return error.what();
  }
  return "none";
}

// Catches: a link with one set of default identifiers that waits for a bench with the other and does not say
// how both agree.
TEST(CanVersions, ABenchWithTheOtherIdentifiersIsNamed) {
  for (const bool fd : {false, true}) {
    for (const bool wide : {false, true}) {
      CanAddress bench = address_with(fd, can::IdSet::kCanopen);
      bench.profile.wide = wide;
      std::string what =
          failure_with(FakeCanBench(bench.profile, kNode).coming, address_with(fd, can::IdSet::kFree));
      EXPECT_NE(what.find("speaks version " + std::string(wide ? "2" : "1") +
                          " of the profile, this program here versions 3 and 4; the address must say "
                          "identifiers=canopen"),
                std::string::npos)
          << what;
      bench = address_with(fd, can::IdSet::kFree);
      bench.profile.wide = wide;
      what = failure_with(FakeCanBench(bench.profile, kNode).coming, address_with(fd, can::IdSet::kCanopen));
      EXPECT_NE(what.find("speaks version " + std::string(wide ? "4" : "3") +
                          " of the profile, this program here versions 1 and 2; the address must say "
                          "identifiers=free"),
                std::string::npos)
          << what;
    }
  }
}

// Catches: a CANopen device, or a bench of another node, taken for a bench of another version.
TEST(CanVersions, AHeartbeatOfCanopenIsNoBench) {
  const std::string what = failure_with({can::Frame{.id = 0x700 + kNode, .size = 1, .data = {5}},
                                         can::Frame{.id = 0x700 + kNode, .size = 8, .data = {5, 9}},
                                         can::Frame{.id = 0x700 + kNode + 1, .size = 8, .data = {5, 1}}},
                                        address_with(false, can::IdSet::kFree));
  EXPECT_EQ(what.find("version"), std::string::npos) << what;
}

// Catches: an identifier that the adapter keeps from the link.
TEST(CanVersions, TheHeartbeatOfTheOtherSetIsHeard) {
  for (const can::IdSet set : {can::IdSet::kFree, can::IdSet::kCanopen}) {
    const std::vector<std::uint32_t> ids = heard_ids(address_with(true, set));
    EXPECT_EQ(std::ranges::count(ids, 0x790 + kNode), 1);
    EXPECT_EQ(std::ranges::count(ids, 0x700 + kNode), 1);
  }
}

// Catches: a link to a bench with CANopen's identifiers that speaks with others.
TEST(CanVersions, ALinkSpeaksToABenchWithTheIdentifiersOfCanopen) {
  const CanAddress address = address_with(true, can::IdSet::kCanopen);
  auto bench = std::make_unique<FakeCanBench>(address.profile, kNode);
  const FakeCanBench& peer = *bench;
  CanLink link(std::move(bench), address, "can:test", kQuick);
  link.acquire();
  EXPECT_EQ(peer.sent.at(0).id, 0x300U + kNode);
  EXPECT_EQ(link.exchange({.tick = 0, .gates = v1::GATES_VOLTAGE, .u_a_v = 1.0}).tick, 1U);
}

}  // namespace
}  // namespace drivebench::link::can_versions_test
