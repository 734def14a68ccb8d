#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "plant/parameters/machine_kind.hpp"

namespace drivebench::synchronous_rows_test {
namespace {

/// A value for each row that no other row has, written through the table and read back.
void expect_rows_of_their_own(AxisParameters p, std::span<const Parameter> rows) {
  const auto value_of = [&](std::size_t n) {
    return rows[n].maximum == 1.0 ? 1.0 : rows[n].minimum + static_cast<double>(n) + 2.0;
  };
  for (std::size_t n = 0; n < rows.size(); ++n)
    rows[n].set(p, value_of(n));
  for (std::size_t n = 0; n < rows.size(); ++n)
    EXPECT_EQ(rows[n].get(p), value_of(n)) << rows[n].name;
}

// Catches: two rows for one member, a row for a member of another kind.
TEST(SynchronousRows, EachRowHasAMemberOfItsOwn) {
  AxisParameters p;
  p.machine = PmMachineParameters{};
  expect_rows_of_their_own(p, PmMachine::kind().rows);
  p.machine = WoundRotorMachineParameters{};
  expect_rows_of_their_own(p, WoundRotorMachine::kind().rows);
}

// Catches: a machine without any torque that is let through, or a reluctance machine that is not.
TEST(SynchronousRows, AMachineWithoutMagnetMustBeSalient) {
  std::vector<Problem> found;
  Problems rules(found);
  add_problems(PmMachineParameters{.inductance_d_h = 1e-3, .inductance_q_h = 2e-3}, rules);
  EXPECT_TRUE(found.empty());
  add_problems(PmMachineParameters{.inductance_d_h = 2e-3, .inductance_q_h = 2e-3}, rules);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].field, "machine.torque_constant_nm_per_a");
  EXPECT_NE(found[0].rule.find("0.002"), std::string::npos) << found[0].rule;
}

// Catches: a coupling above 1, which would make the stored energy negative; a crash on inductances of zero,
// whose own rows complain already.
TEST(SynchronousRows, TheFieldCannotLinkMoreThanAllOfTheStatorFlux) {
  std::vector<Problem> found;
  Problems rules(found);
  WoundRotorMachineParameters p{
      .stator_inductance_h = 0.02, .field_inductance_h = 0.9, .mutual_inductance_h = 0.134};
  add_problems(p, rules);
  EXPECT_TRUE(found.empty());
  p.mutual_inductance_h = 0.135;
  add_problems(p, rules);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].field, "machine.mutual_inductance_h");
  add_problems(WoundRotorMachineParameters{}, rules);
  EXPECT_EQ(found.size(), 1U);
}

}  // namespace
}  // namespace drivebench::synchronous_rows_test
