#include "plant/parameters/drive_rows.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include "plant/parameters/transformer_rows.hpp"

namespace drivebench::drive_rows_test {
namespace {

std::vector<std::string> fields(const DriveParameters& p) {
  std::vector<Problem> found;
  Problems rules(found);
  add_problems(p, rules);
  std::vector<std::string> result;
  for (const Problem& problem : found)
    result.push_back(problem.field);
  return result;
}

using Fields = std::vector<std::string>;

// Catches: two rows of one member or one name, a row that writes elsewhere than it reads, a default out of
// range.
TEST(DriveRows, EveryRowHasAMemberOfItsOwn) {
  std::vector<Parameter> rows(drive_rows().begin(), drive_rows().end());
  rows.insert(rows.end(), transformer_rows().begin(), transformer_rows().end());
  std::set<std::string_view> names;
  const AxisParameters defaults;
  for (const Parameter& row : rows) {
    EXPECT_TRUE(names.insert(row.name).second) << row.name;
    AxisParameters p;
    const double value = row.get(p) == row.maximum ? row.minimum : row.maximum;
    row.set(p, value);
    EXPECT_EQ(row.get(p), value) << row.name;
    for (const Parameter& other : rows) {
      if (&other == &row) continue;
      EXPECT_EQ(other.get(p), other.get(defaults)) << row.name << " moves " << other.name;
    }
    if (row.required) continue;
    EXPECT_EQ(problem_with(row, row.get(defaults)), "") << row.name;
  }
}

// Catches: words in another order than the kinds.
TEST(DriveRows, TheWordsAreThoseOfTheKinds) {
  const auto row = std::find_if(drive_rows().begin(), drive_rows().end(),
                                [](const Parameter& r) { return r.name == "drive.kind"; });
  AxisParameters p;
  p.drive.kind = DriveKind::kSource;
  EXPECT_EQ(row->words[static_cast<std::size_t>(row->get(p))], "source");
  p.drive.kind = DriveKind::kAveraged;
  EXPECT_EQ(row->words[static_cast<std::size_t>(row->get(p))], "averaged_inverter");
  EXPECT_EQ(row->maximum, 4.0);
}

// Catches: a rule that holds for every kind of drive, or for none.
TEST(DriveRows, BrokenRulesBetweenValuesAreNamed) {
  DriveParameters p;
  EXPECT_EQ(fields(p), Fields{});
  p.kind = DriveKind::kCurrent;
  EXPECT_EQ(fields(p), (Fields{"current_loop.proportional_v_per_a", "current_loop.limit_a"}));
  p.current_loop = {.proportional_v_per_a = 20.0, .limit_a = 5.0};
  p.amplifier.filter_hz = 10e3;
  EXPECT_EQ(fields(p), Fields{});
  p.kind = DriveKind::kSwitched;
  EXPECT_EQ(fields(p), Fields{"amplifier.filter_hz"});
}

// Catches: a chopper that cannot work and is accepted.
TEST(DriveRows, BrokenRulesOfTheChopperAreNamed) {
  DriveParameters p;
  p.bus = {.voltage_v = 300.0, .capacitance_f = 1e-3, .chopper_on_v = 400.0, .chopper_off_v = 380.0};
  EXPECT_EQ(fields(p), Fields{});
  p.bus.chopper_off_v = 400.0;
  EXPECT_EQ(fields(p), Fields{"bus.chopper_off_v"});
  p.bus.chopper_off_v = 300.0;
  EXPECT_EQ(fields(p), Fields{"bus.chopper_off_v"});
  p.bus.chopper_off_v = 380.0;
  p.bus.capacitance_f = 0.0;
  EXPECT_EQ(fields(p), Fields{"bus.chopper_on_v"});
}

// Catches: a source without its waveform, a contactor that waits for ever.
TEST(DriveRows, BrokenRulesOfTheSourceAreNamed) {
  DriveParameters p;
  p.source.choose_angle = true;
  p.source.waveform = Waveform::kTable;
  EXPECT_EQ(fields(p), Fields{});  // there is no source
  p.kind = DriveKind::kSource;
  EXPECT_EQ(fields(p), (Fields{"source.choose_angle", "source.table"}));
  p.source.frequency_hz = 50.0;
  p.source.table = Curve({{0.0, 0.0}, {1.1, 1.0}});
  EXPECT_EQ(fields(p), Fields{"source.table"});
  p.source.table = Curve({{0.0, 0.0}, {1.0, 1.0}});
  EXPECT_EQ(fields(p), Fields{});
}

// Catches: a transformer without a source or without a core, one that is forgotten because its ratio is, a
// capacitor or a switch that would connect two of them.
TEST(DriveRows, BrokenRulesOfTheTransformerAreNamed) {
  DriveParameters p;
  p.transformer.secondary_leakage_h = 1e-3;
  EXPECT_EQ(fields(p), Fields{"transformer.turns_ratio"});
  p.transformer.turns_ratio = 0.5;
  EXPECT_EQ(fields(p), (Fields{"transformer.turns_ratio", "transformer.magnetising_inductance_h"}));
  p.kind = DriveKind::kSource;
  p.transformer.magnetising_inductance_h = 1.0;
  EXPECT_EQ(fields(p), Fields{});
  p.source.start_capacitance_f = 1e-6;
  p.source.start_switch = true;
  EXPECT_EQ(fields(p), (Fields{"source.start_capacitance_f", "source.start_switch"}));
}

// Catches: a dead time that leaves nothing of the carrier period, a rule that forgets the periods in a tick.
TEST(DriveRows, TheDeadTimeFitsIntoTheCarrierPeriod) {
  DriveParameters p;
  p.kind = DriveKind::kAveraged;
  p.inverter = {.pwm_periods_per_tick = 4, .dead_time_s = 12e-6};
  std::vector<Problem> found;
  Problems rules(found);
  add_period_problems(p, 100e-6, rules);
  EXPECT_TRUE(found.empty());
  p.inverter.dead_time_s = 12.5e-6;
  add_period_problems(p, 100e-6, rules);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].field, "inverter.dead_time_s");
  EXPECT_EQ(found[0].rule, "is 1.25e-05 but must be below half of the carrier period, which is 2.5e-05 s");
  p.kind = DriveKind::kVoltage;
  add_period_problems(p, 100e-6, rules);
  EXPECT_EQ(found.size(), 1u);
}

}  // namespace
}  // namespace drivebench::drive_rows_test
