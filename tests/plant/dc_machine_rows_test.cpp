#include <gtest/gtest.h>

#include <set>
#include <string>
#include <vector>

#include "plant/parameters/machine_kind.hpp"

namespace drivebench::dc_machine_rows_test {
namespace {

template <class Machine>
AxisParameters axis_with(Machine machine = {}) {
  AxisParameters p;
  p.machine = std::move(machine);
  return p;
}

/// Writes a value of its own into each row, then reads all of them.
template <class Machine>
void expect_each_row_has_a_member_of_its_own(std::span<const Parameter> rows) {
  AxisParameters p = axis_with<Machine>();
  const auto value_of = [&rows](std::size_t n) {
    return rows[n].maximum == 1.0 ? 1.0 : rows[n].minimum + static_cast<double>(n + 1);
  };
  std::set<std::string_view> names;
  for (std::size_t n = 0; n < rows.size(); ++n) {
    rows[n].set(p, value_of(n));
    EXPECT_TRUE(names.insert(rows[n].name).second) << rows[n].name;
  }
  for (std::size_t n = 0; n < rows.size(); ++n)
    EXPECT_EQ(rows[n].get(p), value_of(n)) << rows[n].name;
}

// Catches: two rows that share a member or a name.
TEST(DcMachineRows, EachHasAMemberOfItsOwn) {
  expect_each_row_has_a_member_of_its_own<PmDcMachineParameters>(PmDcMachine::kind().rows);
  expect_each_row_has_a_member_of_its_own<LinearDcMachineParameters>(LinearDcMachine::kind().rows);
  expect_each_row_has_a_member_of_its_own<SeparateDcMachineParameters>(SeparateDcMachine::kind().rows);
  expect_each_row_has_a_member_of_its_own<ShuntDcMachineParameters>(ShuntDcMachine::kind().rows);
  expect_each_row_has_a_member_of_its_own<SeriesDcMachineParameters>(SeriesDcMachine::kind().rows);
}

// Catches: a curve that goes to another machine, or nowhere.
TEST(DcMachineRows, TheSaturationCurveIsReadAndWritten) {
  const std::vector<CurvePoint> points{{0.0, 0.0}, {1.0, 2.0}};
  const auto expect = [&points](AxisParameters p, std::span<const CurveParameter> curves) {
    ASSERT_EQ(curves.size(), 1U);
    EXPECT_TRUE(curves[0].get(p).empty());
    curves[0].set(p, Curve(points));
    EXPECT_EQ(curves[0].get(p).points(), points);
    EXPECT_TRUE(curves[0].rising);
  };
  expect(axis_with<SeparateDcMachineParameters>(), SeparateDcMachine::kind().curves);
  expect(axis_with<ShuntDcMachineParameters>(), ShuntDcMachine::kind().curves);
  expect(axis_with<SeriesDcMachineParameters>(), SeriesDcMachine::kind().curves);
}

template <class Machine>
std::vector<std::string> sentences(const Machine& p) {
  std::vector<Problem> found;
  Problems rules(found);
  add_problems(p, rules);
  std::vector<std::string> result;
  for (const Problem& problem : found)
    result.push_back(problem.field + " " + problem.rule);
  return result;
}

template <class Machine>
void expect_field_rules() {
  using Sentences = std::vector<std::string>;
  Machine p;
  EXPECT_EQ(sentences(p), Sentences{"machine.field_inductance_h is 0 but must be at least 1e-09 H without a "
                                    "machine.saturation_curve"});
  p.field_inductance_h = 2.0;
  EXPECT_EQ(sentences(p), Sentences{});
  p.saturation_curve = Curve({{0.0, 0.5}, {1.0, 1.5}});
  EXPECT_EQ(sentences(p),
            (Sentences{"machine.field_inductance_h is 2 but must be 0 with a machine.saturation_curve",
                       "machine.saturation_curve begins at (0, 0.5) but must begin at (0, 0)"}));
  p.field_inductance_h = 0.0;
  p.saturation_curve = Curve({{0.0, 0.0}, {1.0, 1.5}});
  EXPECT_EQ(sentences(p), Sentences{});
}

// Catches: each rule between the values that is not checked.
TEST(DcMachineRows, TheRulesBetweenTheValuesAreSentences) {
  expect_field_rules<SeparateDcMachineParameters>();
  expect_field_rules<ShuntDcMachineParameters>();
  expect_field_rules<SeriesDcMachineParameters>();
  const SeriesDcMachineParameters series{.field_inductance_h = 1.0, .field_shunt = true};
  EXPECT_EQ(sentences(series),
            std::vector<std::string>{"machine.field_shunt is 1 but must be 0 without a resistor: "
                                     "machine.field_shunt_resistance_ohm is 0"});
  EXPECT_EQ(sentences(LinearDcMachineParameters{}),
            std::vector<std::string>{"machine.flux_density_t is 0 but must not be 0"});
  EXPECT_TRUE(sentences(PmDcMachineParameters{}).empty());
}

}  // namespace
}  // namespace drivebench::dc_machine_rows_test
