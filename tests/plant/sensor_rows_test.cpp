#include "plant/parameters/sensor_rows.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace drivebench::sensor_rows_test {
namespace {

AxisParameters usable() {
  AxisParameters p;
  p.encoder.counts_per_revolution = 2000;
  return p;
}

const Parameter& row_of(std::string_view name) {
  for (const Parameter& row : sensor_rows()) {
    if (row.name == name) return row;
  }
  ADD_FAILURE() << name;
  return sensor_rows()[0];
}

std::vector<Problem> problems_of(const AxisParameters& p) {
  std::vector<Problem> found;
  Problems rules(found);
  add_problems(p.encoder, rules);
  add_problems(p.sensors, rules);
  add_problems(p.thermal, rules);
  return found;
}

// Catches: a row that reads or writes another row's member, one name twice, a default outside of its limits.
TEST(SensorRows, EveryRowHasAMemberOfItsOwn) {
  std::set<std::string_view> names;
  for (const Parameter& row : sensor_rows()) {
    EXPECT_TRUE(names.insert(row.name).second) << row.name;
    AxisParameters p;
    const double start = row.get(p);
    EXPECT_GE(start, row.minimum) << row.name;
    EXPECT_LE(start, row.maximum) << row.name;
    double value = start == row.maximum ? row.minimum : row.maximum;
    if (row.integer) value = std::trunc(value);
    row.set(p, value);
    EXPECT_EQ(row.get(p), value) << row.name;
    for (const Parameter& other : sensor_rows()) {
      if (other.name == row.name) continue;
      EXPECT_EQ(other.get(p), other.get(AxisParameters{})) << row.name;
    }
  }
}

// The sections and keys that a client finds. Catches: a section that is left out of the table, a key of a
// section that is spelt in another way than in the others.
TEST(SensorRows, EveryAnalogSectionHasTheSameKeys) {
  for (const std::string section :
       {"voltage_sensor", "neutral_sensor", "bus_sensor", "temperature_sensor", "tachometer", "resolver"}) {
    const std::string unit = section == "temperature_sensor" ? "k" : "v";
    for (const std::string& key :
         {std::string("enabled"), std::string("bits"), "full_scale_" + unit, std::string("gain"),
          "offset_" + unit, "noise_rms_" + unit, std::string("delay_ticks"), std::string("filter_hz")})
      row_of(section + "." + key);
  }
  for (const char* name :
       {"encoder.swapped", "current_sensor.gain_c", "current_sensor.offset_c_a", "current_sensor.delay_ticks",
        "current_sensor.filter_hz", "hall.offset_rad", "meter.window_s", "thermal.time_constant_s"})
    row_of(name);
}

// Configurations and clients of the first version rely on these rows. Catches: a range or a liveness that
// moved.
TEST(SensorRows, TheRowsOfTheFirstVersionStay) {
  const Parameter& counts = row_of("encoder.counts_per_revolution");
  EXPECT_EQ(counts.minimum, 4);
  EXPECT_EQ(counts.maximum, 1e8);
  EXPECT_TRUE(counts.integer && counts.required && !counts.live);
  const Parameter& bits = row_of("current_sensor.bits");
  EXPECT_EQ(bits.maximum, 24);
  EXPECT_TRUE(bits.integer && !bits.live);
  const Parameter& scale = row_of("current_sensor.full_scale_a");
  EXPECT_EQ(scale.minimum, 1e-6);
  EXPECT_EQ(scale.maximum, 1e6);
  EXPECT_FALSE(scale.live);
  const Parameter& gain = row_of("current_sensor.gain_b");
  EXPECT_EQ(gain.minimum, -100);
  EXPECT_EQ(gain.maximum, 100);
  EXPECT_TRUE(gain.live);
  EXPECT_TRUE(row_of("current_sensor.offset_a_a").live);
  EXPECT_TRUE(row_of("current_sensor.noise_rms_a").live);
  EXPECT_EQ(row_of("current_sensor.noise_rms_a").minimum, 0);
}

// Catches: a delay that no history holds, in any section.
TEST(SensorRows, ADelayIsRefusedUnlessTheHistoryHoldsIt) {
  EXPECT_TRUE(problems_of(usable()).empty());
  for (const std::string section : {"current_sensor", "voltage_sensor", "neutral_sensor", "bus_sensor",
                                    "temperature_sensor", "tachometer", "resolver"}) {
    const Parameter& row = row_of(section + ".delay_ticks");
    AxisParameters p = usable();
    row.set(p, 1.5);
    const std::vector<Problem> found = problems_of(p);
    ASSERT_EQ(found.size(), 1u) << section;
    EXPECT_EQ(found[0].field, row.name);
    EXPECT_EQ(found[0].rule, "is 1.5 but must be 0, 0.5 or a whole number of ticks up to 8");
    row.set(p, 0.5);
    EXPECT_TRUE(problems_of(p).empty());
  }
}

// Catches: a rule that is not applied, or applied to a sensor that is off.
TEST(SensorRows, BrokenRulesBetweenValuesAreNamed) {
  const auto field = [](const AxisParameters& p) {
    const std::vector<Problem> found = problems_of(p);
    return found.size() == 1 ? found[0].field : std::to_string(found.size());
  };
  AxisParameters p = usable();
  p.encoder.counts_per_revolution = 2002;
  EXPECT_EQ(field(p), "encoder.counts_per_revolution");
  p = usable();
  p.sensors.tachometer.analog.enabled = true;
  EXPECT_EQ(field(p), "tachometer.gain_vs_per_rad");
  p.sensors.tachometer.gain_vs_per_rad = -0.1;
  EXPECT_EQ(field(p), "0");
  p.sensors.tachometer.ripple = 0.1;
  EXPECT_EQ(field(p), "tachometer.ripple_per_turn");
  p = usable();
  p.thermal.reference_k = 600.0;
  p.thermal.stator_coefficient_per_k = 0.003;
  EXPECT_EQ(field(p), "0");
  p.thermal.enabled = true;
  EXPECT_EQ(field(p), "thermal.rotor_coefficient_per_k");
}

}  // namespace
}  // namespace drivebench::sensor_rows_test
