#include "tests/adversity/simulator/account/account.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace drivebench::simulator::account_test {
namespace {

constexpr Owner kAnna = 9;

/// The account of an axis in real time that kAnna drives.
class AccountTest : public testing::Test {
 protected:
  AccountTest() {
    account_.granted(kAnna, 0, account_.forces(), [] { return true; });
    see(ControlState::kRun);
  }

  void see(ControlState state) {
    account_.see({.tick = ++tick_, .state = static_cast<std::uint64_t>(state), .owner = kAnna}, 0);
  }

  std::uint64_t tick_ = 0;
  std::vector<std::string> broken_;
  AxisAccount account_{BenchSetup{}, 0, false,
                       [this](const std::string& promise) { broken_.push_back(promise); }};
};

// Catches: an account that lets a driven axis become idle, or only while its session is there.
TEST_F(AccountTest, AnOwnedAxisDoesNotBecomeIdleByItself) {
  see(ControlState::kIdle);
  EXPECT_EQ(broken_.size(), 1u);
  see(ControlState::kRun);
  account_.gone(kAnna, false);
  see(ControlState::kIdle);
  EXPECT_EQ(broken_.size(), 2u);
}

// Catches: an account that forgets with the session that it gave the lease back and took it again. The I/O
// stood still: it learns of the departure first, and sees the earlier ticks afterwards.
TEST_F(AccountTest, ALeaseGivenBackAndTakenAgainBeginsAnewAlsoForASessionThatHasGone) {
  account_.may_go(kAnna);
  account_.gone(kAnna, false);
  see(ControlState::kIdle);
  EXPECT_EQ(broken_, std::vector<std::string>{});
}

// Catches: an account that blames the bench for a lease that an administrator took while its answer was on
// its way; one that lets an axis change its owner ever after.
TEST_F(AccountTest, AnAnswerThatWasUnderWayDuringAForceSaysNothing) {
  const std::uint64_t asked = account_.forces();
  account_.force_begins();
  account_.force_ends();
  for (const std::uint64_t forces : {asked, account_.forces()}) {
    account_.granted(kAnna, static_cast<Tick>(tick_), forces, [] { return true; });
    account_.see({.tick = ++tick_, .state = static_cast<std::uint64_t>(ControlState::kRun), .owner = 5}, 0);
    EXPECT_EQ(broken_.empty(), forces == asked);
    see(ControlState::kRun);
  }
}

// Catches: an account that lets the lease of a closed session stay.
TEST_F(AccountTest, TheLeaseOfAClosedSessionIsGivenBack) {
  account_.may_go(kAnna);
  account_.gone(kAnna, false);
  account_.io_done(kAnna);
  for (int i = 0; i < 3; ++i)
    see(ControlState::kRun);
  EXPECT_EQ(broken_.size(), 1u);
  see(ControlState::kIdle);
  EXPECT_EQ(broken_.size(), 2u) << "what it gave back counts until its departure shows";
}

}  // namespace
}  // namespace drivebench::simulator::account_test
