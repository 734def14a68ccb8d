#include "server/access/admission.hpp"

#include <gtest/gtest.h>

#include <string>

namespace drivebench::admission_test {
namespace {

using namespace std::chrono_literals;

const Admission::WallTime kNoon = std::chrono::sys_days(std::chrono::year(2026) / 11 / 22) + 12h;

std::vector<Grant> two_grants() {
  return {{.name = "anna", .role = Role::kOperator, .hash = hash_of_token("right")},
          {.name = "ben",
           .role = Role::kViewer,
           .hash = hash_of_token("until one"),
           .until = std::chrono::floor<std::chrono::seconds>(kNoon) + 1h}};
}

class AdmissionTest : public ::testing::Test {
 protected:
  Admission::Decision try_with(const std::string& token, const std::string& address = "192.0.2.1") {
    return admission.admit(token, address, now, wall);
  }

  Admission admission{true, two_grants()};
  Admission::Time now{1000s};
  Admission::WallTime wall = kNoon;
};

// Catches: guesses that cost nothing, and a wait that never grows or never ends.
TEST_F(AdmissionTest, SEC_04_TenThousandGuessesAreHeldUp) {
  int looked_at = 0;
  for (int guess = 0; guess < 10'000; ++guess) {
    const Admission::Decision decision = try_with("guess " + std::to_string(guess));
    EXPECT_FALSE(decision.admitted);
    looked_at += decision.looked_at ? 1 : 0;
    now += 100ms;
  }
  // In 1000 s: at 0, 0.5, 1.5, 3.5, 7.5, 15.5, 31.5 s and then every 30 s.
  EXPECT_EQ(looked_at, 7 + static_cast<int>((999.9 - 31.5) / 30.0));
  EXPECT_FALSE(try_with("right").admitted) << "no token is looked at during the wait";
  now += 30s;
  EXPECT_TRUE(try_with("right").admitted);
}

// Catches: a wait of another length than promised, and one that a right token does not end.
TEST_F(AdmissionTest, SEC_04_TheWaitDoublesAndARightTokenEndsIt) {
  for (const auto wait : {500ms, 1000ms, 2000ms, 4000ms, 8000ms, 16'000ms, 30'000ms, 30'000ms}) {
    EXPECT_TRUE(try_with("wrong").looked_at);
    now += wait - 1ms;
    EXPECT_FALSE(try_with("right").looked_at);
    now += 1ms;
  }
  EXPECT_TRUE(try_with("right").admitted);
  EXPECT_TRUE(try_with("wrong").looked_at);
  now += 500ms;
  EXPECT_TRUE(try_with("right").admitted) << "after a right token the wait is short again";
}

// Catches: a client that shows no token first, as a browser does, and is refused with the right one; and a
// wait that such a client ends or gets around.
TEST_F(AdmissionTest, SEC_04_NoTokenIsNoGuess) {
  for (int client = 0; client < 10; ++client)
    EXPECT_FALSE(try_with("").admitted);
  EXPECT_TRUE(try_with("right").admitted);
  EXPECT_FALSE(try_with("wrong").admitted);
  EXPECT_FALSE(try_with("").admitted);
  EXPECT_FALSE(try_with("right").looked_at) << "the wait after a wrong one goes on";
}

// Catches: guesses from one address that lock the others out.
TEST_F(AdmissionTest, SEC_04_OtherAddressesDoNotWait) {
  EXPECT_FALSE(try_with("wrong").admitted);
  EXPECT_TRUE(try_with("right", "192.0.2.2").admitted);
}

// Catches: a table that grows with every address that guesses.
TEST_F(AdmissionTest, SEC_04_TheTableOfAddressesIsBounded) {
  for (int peer = 0; peer < 10'000; ++peer) {
    try_with("wrong", "peer " + std::to_string(peer));
    now += 1ms;
    ASSERT_LE(admission.addresses_that_wait(), GuessLimit::kMaxAddresses);
  }
  EXPECT_FALSE(try_with("wrong", "peer 9999").looked_at) << "the newest addresses still wait";
}

// Catches: tokens that open a session after their time, after they were revoked, or after they were removed
// from the file.
TEST_F(AdmissionTest, OWN_07_SEC_04_ATokenHoldsUntilItEndsOrIsTakenAway) {
  EXPECT_EQ(try_with("until one").grant.name, "ben");
  wall += 1h;
  const Admission::Decision late = try_with("until one");
  EXPECT_FALSE(late.admitted);
  EXPECT_NE(late.why_not.find("over"), std::string::npos);
  wall = kNoon;
  std::vector<Grant> grants = two_grants();
  const Grant anna = grants[0];
  EXPECT_NE(admission.renewed(anna, wall), nullptr);
  grants[0].revoked = true;
  admission.replace(grants);
  EXPECT_EQ(admission.renewed(anna, wall), nullptr);
  now += 30s;
  EXPECT_FALSE(try_with("right").admitted);
  admission.replace({});
  now += 30s;
  EXPECT_FALSE(try_with("until one").admitted) << "without entries no token opens anything";
}

// Catches: a bench without tokens on which no session may do anything.
TEST(Admission, WithoutTokensEverySessionIsAnAdministrator) {
  Admission open(false, {});
  const Admission::Decision decision = open.admit("whatever", "127.0.0.1", Admission::Time{}, kNoon);
  EXPECT_TRUE(decision.admitted);
  EXPECT_EQ(decision.grant.role, Role::kAdmin);
  EXPECT_EQ(open.renewed(decision.grant, kNoon), &decision.grant) << "it stays so";
}

}  // namespace
}  // namespace drivebench::admission_test
