#include "server/access/audit_budget.hpp"

#include <gtest/gtest.h>

#include <string>

namespace drivebench::audit_budget_test {
namespace {

using namespace std::chrono_literals;

class AuditBudgetTest : public ::testing::Test {
 protected:
  int take(const std::string& kind, const std::string& address, int attempts) {
    int taken = 0;
    for (int n = 0; n < attempts; ++n)
      taken += budget.take(kind, address, now) ? 1 : 0;
    return taken;
  }

  AuditBudget budget;
  AuditBudget::Time now{1000s};
};

// Catches: a flood at three addresses that leaves nothing to a fourth one or to another kind of event; an
// address or a kind without a limit; a budget that does not come back.
TEST_F(AuditBudgetTest, SEC_07_KindsAndAddressesHaveTheirOwn) {
  for (const char* const address : {"a", "b", "c"})
    EXPECT_EQ(take("authentication", address, 1000), 100);
  EXPECT_EQ(take("authentication", "d", 50), 50);
  EXPECT_EQ(take("authentication", "e", 1000), 50) << "400 of a kind";
  EXPECT_EQ(take("authentication", "f", 1), 0);
  EXPECT_EQ(take("malformed", "a", 1000), 100) << "another kind";
  now += 3s;
  EXPECT_EQ(take("authentication", "a", 1000), 6) << "2 a second";
  EXPECT_EQ(take("authentication", "f", 1000), 24) << "the rest of 10 a second of the kind";
  now += 1h;
  EXPECT_EQ(take("authentication", "a", 1000), 100);
}

// Catches: a table that a stranger with a network of addresses grows, and an address that empties its budget,
// lets itself be forgotten and begins anew without end.
TEST_F(AuditBudgetTest, SEC_07_TheTableOfAddressesIsBounded) {
  int taken = 0;
  for (int n = 0; n < 10'000; ++n) {
    taken += take("malformed", "address " + std::to_string(n), 1);
    now += 1ms;
  }
  EXPECT_EQ(budget.addresses(), AuditBudget::kMaxAddresses);
  EXPECT_LE(taken, 400 + 100);
  EXPECT_GE(taken, 400 + 95);
}

}  // namespace
}  // namespace drivebench::audit_budget_test
