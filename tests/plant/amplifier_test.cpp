#include "plant/drive/amplifier.hpp"

#include <gtest/gtest.h>

namespace drivebench::amplifier_test {
namespace {

// Catches: a gain that reaches the offset, offsets exchanged, a phase or the field forgotten.
TEST(Amplifier, TheGainActsBeforeTheOffsetOfEachPhase) {
  const AmplifierParameters p{.gain = 2.0, .offset_a_v = 0.5, .offset_b_v = -1.0, .offset_c_v = 0.25};
  const PhaseValues out = amplified(p, {.a = 3.0, .b = 4.0, .c = -5.0, .field = 6.0});
  EXPECT_EQ(out.a, 6.5);
  EXPECT_EQ(out.b, 7.0);
  EXPECT_EQ(out.c, -9.75);
  EXPECT_EQ(out.field, 12.0);
}

// Catches: a limit on one side only, a flag of one phase that another one takes back.
TEST(Amplifier, TheLimitHoldsForEachPhase) {
  LimitedVoltages out = clipped({10.0, -10.0, 7.0}, 10.0);  // exactly the limit is not clipped
  EXPECT_EQ(out.voltage_v.a, 10.0);
  EXPECT_EQ(out.voltage_v.b, -10.0);
  EXPECT_EQ(out.voltage_v.c, 7.0);
  EXPECT_FALSE(out.saturated);
  for (const ThreePhase& wanted : {ThreePhase{10.01, 0.0, 0.0}, {0.0, -1e308, 0.0}, {0.0, 0.0, 11.0}}) {
    out = clipped(wanted, 10.0);
    EXPECT_EQ(out.voltage_v.a, wanted.a == 0.0 ? 0.0 : 10.0);
    EXPECT_EQ(out.voltage_v.b, wanted.b == 0.0 ? 0.0 : -10.0);
    EXPECT_EQ(out.voltage_v.c, wanted.c == 0.0 ? 0.0 : 10.0);
    EXPECT_TRUE(out.saturated);
  }
}

// Catches: a decay applied to the output instead of to its distance from the input.
TEST(Amplifier, TheFilterGoesTowardsItsInputAndStaysOnIt) {
  EXPECT_EQ(filtered(2.0, 10.0, 1.0), 2.0);
  EXPECT_EQ(filtered(2.0, 10.0, 0.5), 6.0);
  EXPECT_EQ(filtered(0.1, 0.1, 0.3), 0.1);
}

}  // namespace
}  // namespace drivebench::amplifier_test
