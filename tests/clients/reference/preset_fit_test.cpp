#include "clients/reference/preset_fit.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace drivebench::reference::preset_fit_test {
namespace {

// Catches: a preset that is run on a bench it was not made for.
TEST(Mismatches, NameKindsRateCountsPolePairsAndVoltage) {
  const control::Requirements& needs = control::find_preset("book/8.2.2")->needs;
  v1::BenchDescription bench;
  bench.set_period_s(125e-6);
  v1::AxisDescription& axis = *bench.add_axes();
  const auto set = [&axis](const char* name, double value) {
    v1::ParameterDescription& row = *axis.add_parameters();
    row.set_name(name);
    row.set_value(value);
  };
  set("encoder.counts_per_revolution", 2000);
  set("machine.pole_pairs", 3);
  set("amplifier.voltage_limit_v", 80);
  EXPECT_TRUE(mismatches({bench, 0}, needs, 8000.0).empty());  // a link without kinds
  axis.set_machine_kind("induction");
  axis.set_drive_kind("voltage_amplifier");
  EXPECT_TRUE(mismatches({bench, 0}, needs, 8000.0).empty());
  control::Requirements field = needs;
  field.signal = "i_f_a";
  EXPECT_TRUE(mismatches({bench, 0}, field, 8000.0).empty());
  EXPECT_EQ(mismatches({bench, 0, 0}, field, 8000.0).size(), 1U);
  control::Requirements currents = needs;
  currents.quantity = control::Quantity::kCurrent;
  EXPECT_EQ(mismatches({bench, 0}, currents, 8000.0).size(), 1U);
  axis.set_machine_kind("pm_dc");
  axis.set_drive_kind("current_amplifier");
  EXPECT_EQ(mismatches({bench, 0}, needs, 8000.0).size(), 2U);
  bench.set_period_s(250e-6);
  for (v1::ParameterDescription& row : *axis.mutable_parameters())
    row.set_value(row.value() / 2.0);
  EXPECT_EQ(mismatches({bench, 0}, needs, 8000.0).size(), 6U);
}

// Catches: a gain that changes the controller but not what it is checked against.
TEST(Mismatches, GainsThatDescribeTheAxisChangeTheRequirements) {
  const control::Preset& preset = *control::find_preset("book/8.2.2");
  const std::vector<control::Gain> gains = {
      {"counts_per_revolution", 4000.0}, {"machine.pole_pairs", 2.0}, {"voltage_limit_v", 60.0}};
  const control::Requirements needs = needs_of(preset, gains);
  EXPECT_EQ(needs.counts_per_revolution, 4000.0);
  EXPECT_EQ(needs.pole_pairs, 2.0);
  EXPECT_EQ(needs.voltage_limit_v, 60.0);
}

}  // namespace
}  // namespace drivebench::reference::preset_fit_test
