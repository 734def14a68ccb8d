#include "clients/regression/suite/step_reader.hpp"

#include <fmt/core.h>

#include <array>
#include <optional>
#include <string_view>

#include "clients/regression/checks/check_reader.hpp"

namespace drivebench::regression {
namespace {

/// What a check needs of a multisine; the bench judges the values.
std::optional<Excitation> read_multisine(KeyTable& table, Step& step) {
  std::optional<KeyTable> inner = table.table("multisine");
  if (!inner) return std::nullopt;
  step.multisine = *table.node("multisine");
  const auto load_nm = inner->number("load_nm");
  const auto offset_a = inner->number("current_offset_a");
  if (inner->has("load_nm") == inner->has("current_offset_a")) {
    inner->report("load_nm", "or else current_offset_a must stand in a multisine");
  }
  for (const std::string_view key : {"period_s", "periods", "from_hz", "to_hz"})
    inner->require(key);
  const auto period_s = inner->number("period_s", 0.0);
  const auto periods = inner->integer("periods", 1, kMostMultisinePeriods);
  const auto from_hz = inner->number("from_hz", 0.0);
  const auto to_hz = inner->number("to_hz", 0.0);
  const auto ratio = inner->number("ratio", kLeastMultisineRatio, kMostMultisineRatio);
  inner->finish();
  if ((!load_nm && !offset_a) || !period_s || !periods || !from_hz || !to_hz) return std::nullopt;
  return Excitation{.is_load = load_nm.has_value(),
                    .amplitude = load_nm.value_or(offset_a.value_or(0.0)),
                    .begin_s = step.at_s.value_or(step.delay_s),
                    .has_trigger = step.when.has_value(),
                    .period_s = *period_s,
                    .periods = static_cast<double>(*periods),
                    .from_hz = *from_hz,
                    .to_hz = *to_hz,
                    .ratio = ratio.value_or(kDefaultMultisineRatio)};
}

/// Exactly one of the actions. The value of a parameter or a fault is for the bench to judge.
void read_action(KeyTable& table, Step& step) {
  struct Row {
    std::string_view key;
    Step::Action action;
  };
  static constexpr auto kActions = std::to_array<Row>({{"load_nm", Step::Action::kLoad},
                                                       {"parameter", Step::Action::kParameter},
                                                       {"fault", Step::Action::kFault},
                                                       {"impulse_nms", Step::Action::kImpulse},
                                                       {"multisine", Step::Action::kMultisine},
                                                       {"line", Step::Action::kMessage},
                                                       {"can", Step::Action::kMessage},
                                                       {"modbus", Step::Action::kMessage}});
  const bool has_name = table.has("parameter") || table.has("fault");
  std::size_t count = 0;
  for (const Row& row : kActions) {
    if (!table.has(row.key)) {
      table.node(row.key);  // a key that may stand here
      continue;
    }
    ++count;
    step.action = row.action;
    if (row.action == Step::Action::kMultisine) {
      step.excitation = read_multisine(table, step);
    } else if (row.action == Step::Action::kMessage) {
      if (row.key == "line" ? table.text(row.key).has_value() : table.table(row.key).has_value())
        step.message = *table.node(row.key);
    } else if (row.action == Step::Action::kParameter || row.action == Step::Action::kFault) {
      step.name = table.text(row.key).value_or("");
    } else if (table.number(row.key)) {
      step.value = *table.node(row.key);
    }
  }
  if (count != 1) {
    table.report("load_nm",
                 fmt::format("is one of load_nm, parameter, fault, impulse_nms, multisine, line, can and "
                             "modbus, of which a step has exactly one; here are {}",
                             count));
  }
  const ConfigNode* const value = table.node("value");
  if (has_name) table.require("value");
  if (value == nullptr) return;
  if (!has_name) table.report("value", "belongs to parameter and fault");
  if (value->kind != ConfigNode::Kind::kScalar) table.report("value", "must be a single value");
  step.value = *value;
}

}  // namespace

Step read_step(KeyTable& table) {
  Step step;
  step.line = table.line();
  step.axis = table.text("axis").value_or("0");
  step.at_s = table.number("at_s", 0.0, kLongestCase_s);
  step.when = read_condition(table, "when");
  if (table.has("at_s") == table.has("when")) {
    table.report("at_s", "or else when must stand in a step: a time, or a condition");
  }
  step.for_s = table.number("for_s", 0.0, kLongestCase_s).value_or(0.0);
  step.delay_s = table.number("delay_s", 0.0, kLongestCase_s).value_or(0.0);
  for (const std::string_view key : {"for_s", "delay_s"}) {
    if (table.has(key) && !table.has("when")) table.report(key, "belongs to when");
  }
  read_action(table, step);
  step.ramp_s = table.number("ramp_s", 0.0, kLongestCase_s).value_or(0.0);
  if (table.has("ramp_s") && !table.has("load_nm") && !table.has("parameter")) {
    table.report("ramp_s", "belongs to load_nm and parameter");
  }
  table.finish();
  return step;
}

}  // namespace drivebench::regression
