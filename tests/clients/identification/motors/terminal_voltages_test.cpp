#include "clients/identification/motors/terminal_voltages.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace drivebench::identification::terminal_voltages_test {
namespace {

MeasuredData record(double (*value)(int)) {
  MeasuredData data{.period_s = 1e-3, .columns = {{"u_a_v", "V", {}}}};
  for (int k = 0; k < 100; ++k)
    data.columns[0].values.push_back(value(k));
  return data;
}

TerminalVoltages voltages(const MeasuredData& data, double shift) {
  Settings e{.kind = MotorKind::kDc};
  e.processing.voltage_shift = shift;
  return {data, e};
}

// The mean of the period before its sample holds throughout that period; a command that arrives 1.6 periods
// late shares a period with the one before it, 0.6 to 0.4. Catches: a voltage a period early or late, edges
// that are rounded.
TEST(TerminalVoltages, AHeldValueFillsItsPeriod) {
  const MeasuredData data = record([](int k) { return static_cast<double>(k); });
  for (const double part : {0.0, 0.5, 1.0}) {
    EXPECT_DOUBLE_EQ(voltages(data, 0.5).at(10, part)[0], 11.0);
    EXPECT_DOUBLE_EQ(voltages(data, -0.5).at(10, part)[0], 10.0);
    EXPECT_NEAR(voltages(data, -2.1).at(10, part)[0], 10.0 - 1.6, 1e-12);
  }
}

// The voltage of a line lies on its cubic: a sine of 20 samples to 1e-4. Catches: a line in steps, a cubic
// that is off by a sample.
TEST(TerminalVoltages, AnInstantaneousValueRunsThroughACubic) {
  const MeasuredData data = record([](int k) { return std::cos(0.314 * k); });
  EXPECT_NEAR(voltages(data, 0.0).at(50, 0.5)[0], std::cos(0.314 * 50.5), 5e-4);
  EXPECT_NEAR(voltages(data, 0.2).at(50, 0.5)[0], std::cos(0.314 * 50.7), 5e-4);
}

// Every fourth sample from the third on: a held voltage is the mean of its four periods, one at an instant is
// that of the same instant. Catches: the first of the four periods for all of them, which is 1.5 periods
// late; a shift in periods of the whole record.
TEST(TerminalVoltages, ThinnedVoltagesKeepTheirMeanAndTheirInstant) {
  const MeasuredData data = record([](int k) { return static_cast<double>(k); });
  EXPECT_DOUBLE_EQ(voltages(data, -0.5).thinned(3, 4).at(2, 0.5)[0], 11.0 + 1.5);
  EXPECT_NEAR(voltages(data, 0.2).thinned(3, 4).at(2, 0.5)[0], 11.0 + 2.0 + 0.2, 1e-12);
}

}  // namespace
}  // namespace drivebench::identification::terminal_voltages_test
