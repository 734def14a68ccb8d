#include "server/config/sections/events.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <set>
#include <string_view>
#include <tuple>
#include <utility>

#include "plant/parameters/drive_rows.hpp"
#include "protocols/text.hpp"
#include "server/bench/ramps.hpp"
#include "server/config/sections/axis.hpp"
#include "server/config/sections/parameters.hpp"

namespace drivebench {
namespace {

constexpr auto kFaultNames = [] {
  std::array<std::string_view, kInjectableFaultCount> names{};
  for (std::size_t row = 0; row < names.size(); ++row)
    names[row] = kInjectableFaults[row].name;
  return names;
}();

void read_loads(StrictTable& axis, const EventPlace& place, std::vector<AxisEvent>& events) {
  for (StrictTable& table : axis.tables("load", kMaxAxisEvents)) {
    const EventTime time = read_event_time(table, place);
    const auto load_nm = table.real("load_nm", -kMaxLoadNm, kMaxLoadNm);
    const auto ramp = read_ticks(table, "ramp_s", "ramp_ticks", place.period_ns);
    table.require("load_nm");
    table.finish();
    events.push_back({.tick = time.tick,
                      .action = LoadChange{.load_nm = load_nm.value_or(0.0), .ramp_ticks = ramp.value_or(0)},
                      .trigger = time.trigger});
  }
}

void read_bumps(StrictTable& axis, const EventPlace& place, std::vector<AxisEvent>& events) {
  for (StrictTable& table : axis.tables("bump", kMaxAxisEvents)) {
    const EventTime time = read_event_time(table, place);
    const auto impulse_nms = table.real("impulse_nms", -kMaxImpulseNms, kMaxImpulseNms);
    table.require("impulse_nms");
    table.finish();
    events.push_back(
        {.tick = time.tick, .action = ShaftBump{impulse_nms.value_or(0.0)}, .trigger = time.trigger});
  }
}

void read_faults(StrictTable& axis, SharedParts shared, const EventPlace& place,
                 std::vector<AxisEvent>& events) {
  for (StrictTable& table : axis.tables("fault", kMaxAxisEvents)) {
    const auto name = table.choice("name", kFaultNames);
    const EventTime begin = read_event_time(table, place);
    const auto end = read_event_end(table, begin, place.period_ns);
    const auto value = table.real("value");
    table.require("name");
    table.require("value");
    if (name && value) {
      const std::string rule = problem_with(kInjectableFaults[*name], *value);
      if (!rule.empty()) table.report("value", rule);
    }
    if (name && shared.drive && is_of_drive(kInjectableFaults[*name])) {
      table.report("name", "is \"" + std::string(kFaultNames[*name]) +
                               "\", a fault of the axis whose amplifier this one shares");
    }
    table.finish();
    const auto row = static_cast<std::uint32_t>(name.value_or(0));
    const auto add = [&](const EventTime& time, double to) {
      events.push_back(
          {.tick = time.tick, .action = InjectFault{.row = row, .value = to}, .trigger = time.trigger});
    };
    add(begin, value.value_or(0.0));
    if (end) add(*end, 0.0);
  }
}

/// A parameter change and its table.
struct Setting {
  EventTime time;
  ParameterWrite write;
  StrictTable table;
};

/// The row of the parameter that a setting names; null if the parameter is not live.
const Parameter* read_row(StrictTable& table, const AxisParameters* p, SharedParts shared) {
  const auto name = table.text("parameter", 200);
  table.require("parameter");
  if (!name || p == nullptr) return nullptr;
  const Parameter* const row = find_parameter(*p, *name);
  const auto report = [&](const std::string& why) {
    table.report("parameter", "is \"" + printable(*name) + "\", " + why);
    return nullptr;
  };
  if (row == nullptr) return report("but there is no such parameter");
  if (!row->live) return report("which cannot be changed while the bench runs");
  if (shared.shaft && section_of(row->name) == "mechanics") {
    return report("which belongs to the axis whose shaft this one shares");
  }
  if (shared.drive && is_of_drive(row->name)) {
    return report("which belongs to the axis whose amplifier this one shares");
  }
  return row;
}

std::optional<Setting> read_setting(StrictTable& table, const AxisParameters* p, SharedParts shared,
                                    const EventPlace& place) {
  const Parameter* const row = read_row(table, p, shared);
  const EventTime time = read_event_time(table, place);
  const auto ramp = read_ticks(table, "ramp_s", "ramp_ticks", place.period_ns);
  const auto value = row != nullptr ? read_value(table, "value", *row) : std::nullopt;
  if (row == nullptr) table.node("value");
  table.require("value");
  if (row != nullptr && row->integer && ramp.value_or(0) != 0) {
    table.report(table.has("ramp_s") ? "ramp_s" : "ramp_ticks",
                 "must be 0: " + std::string(row->name) + " has no values in between");
  }
  table.finish();
  if (!value) return std::nullopt;
  return Setting{.time = time,
                 .write = {.row = static_cast<std::uint32_t>(row - axis_parameters(*p).data()),
                           .value = *value,
                           .ramp_ticks = ramp.value_or(0)},
                 .table = table};
}

bool report_broken(Setting& setting, Tick tick, const AxisParameters& p) {
  const std::vector<Problem> broken = problems(p);
  if (broken.empty()) return false;
  setting.table.report("value", "would break a rule at tick " + std::to_string(tick) + ": " +
                                    broken.front().field + " " + broken.front().rule);
  return true;
}

/// Applies the settings, none of which has a trigger, as the bench will, and reports the first that breaks a
/// rule between values. Checks at the begin and end of each setting.
void check_settings(std::vector<Setting>& settings, AxisParameters p) {
  std::set<Tick> ticks;
  for (const Setting& setting : settings)
    ticks.insert({setting.time.tick, setting.time.tick + setting.write.ramp_ticks});
  const std::span<const Parameter> rows = axis_parameters(p);
  ParameterRamps ramps;
  auto next = settings.begin();
  for (const Tick tick : ticks) {
    for (std::size_t i = ramps.count; i-- > 0;) {
      const ParameterRamp ramp = ramps.ramp[i];
      rows[ramp.row].set(p, ramp.at(tick));
      if (ramp.is_over(tick)) ramps.remove(i);
    }
    for (; next != settings.end() && next->time.tick == tick; ++next) {
      const auto& [row, value, ramp_ticks] = next->write;
      ramps.forget(row);
      if (ramp_ticks == 0) {
        rows[row].set(p, value);
      } else if (!ramps.add({row, rows[row].get(p), value, tick, ramp_ticks})) {
        return next->table.report("parameter", "would be on its way together with " +
                                                   std::to_string(kMaxRamps) +
                                                   " others, the most that an axis can have");
      }
      if (ramp_ticks == 0 && report_broken(*next, tick, p)) return;
    }
    if (report_broken(*std::prev(next), tick, p)) return;
  }
}

void read_settings(StrictTable& axis, const AxisParameters* p, SharedParts shared, const EventPlace& place,
                   std::vector<AxisEvent>& events) {
  std::vector<Setting> timed;
  bool all_right = p != nullptr;
  for (StrictTable& table : axis.tables("set", kMaxAxisEvents)) {
    const auto setting = read_setting(table, p, shared, place);
    all_right = all_right && setting;
    if (!setting) continue;
    events.push_back(
        {.tick = setting->time.tick, .action = setting->write, .trigger = setting->time.trigger});
    if (!setting->time.trigger) timed.push_back(*setting);
  }
  std::stable_sort(timed.begin(), timed.end(),
                   [](const Setting& x, const Setting& y) { return x.time.tick < y.time.tick; });
  if (all_right) check_settings(timed, *p);
}

/// The rank of an event within its tick.
int rank_of(const Action& action) {
  if (std::holds_alternative<LoadChange>(action)) return 0;
  if (std::holds_alternative<ParameterWrite>(action)) return 1;
  if (const auto* fault = std::get_if<InjectFault>(&action)) return fault->value == 0.0 ? 2 : 3;
  return 4;
}

}  // namespace

std::vector<AxisEvent> in_order(std::vector<AxisEvent> events) {
  std::stable_sort(events.begin(), events.end(), [](const AxisEvent& x, const AxisEvent& y) {
    return std::tuple(x.trigger.has_value(), x.tick, rank_of(x.action)) <
           std::tuple(y.trigger.has_value(), y.tick, rank_of(y.action));
  });
  return events;
}

std::vector<AxisEvent> read_events(StrictTable& axis, const AxisParameters* p, SharedParts shared,
                                   const EventPlace& place) {
  std::vector<AxisEvent> events;
  read_loads(axis, place, events);
  read_settings(axis, p, shared, place, events);
  read_faults(axis, shared, place, events);
  read_bumps(axis, place, events);
  return in_order(std::move(events));
}

}  // namespace drivebench
