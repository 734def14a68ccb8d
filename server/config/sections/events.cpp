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

constexpr double kMaxHz = 1e9;

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

/// The lines of a multisine from its frequencies; a rule that they break is a problem.
MultisineLines read_lines(StrictTable& table, const EventPlace& place) {
  const auto period = read_ticks(table, "period_s", "period_ticks", place.period_ns);
  const auto from_hz = table.real("from_hz", 0.0, kMaxHz);
  const auto to_hz = table.real("to_hz", 0.0, kMaxHz);
  const auto ratio = table.real("ratio", kLeastMultisineRatio, kMostMultisineRatio);
  if (!table.has("period_ticks")) table.require("period_s");
  table.require("from_hz");
  table.require("to_hz");
  if (!period || !from_hz || !to_hz) return {};
  const std::string_view period_key = table.has("period_s") ? "period_s" : "period_ticks";
  if (*period < kShortestMultisinePeriod || *period > kLongestMultisinePeriod) {
    table.report(period_key, "comes to " + std::to_string(*period) + " ticks but must come to " +
                                 std::to_string(kShortestMultisinePeriod) + " to " +
                                 std::to_string(kLongestMultisinePeriod));
    return {};
  }
  const auto ticks = static_cast<std::uint32_t>(*period);
  const double tick_s = static_cast<double>(place.period_ns) * 1e-9;
  const MultisineLines lines{.period_ticks = ticks,
                             .lowest = nearest_multiple(*from_hz, ticks, tick_s),
                             .highest = nearest_multiple(*to_hz, ticks, tick_s),
                             .ratio = ratio.value_or(kDefaultMultisineRatio)};
  const double least_hz = 1.0 / (static_cast<double>(ticks) * tick_s);
  const double half_rate_hz = 0.5 / tick_s;
  if (lines.lowest < 1) {
    table.report("from_hz", "is " + shortest(*from_hz) + " but must come to one period in period_s, " +
                                shortest(least_hz) + " Hz, at least");
  } else if (lines.highest < lines.lowest) {
    table.report("to_hz", "is " + shortest(*to_hz) + " but must not lie below from_hz");
  } else if (lines.highest >= (ticks + 1) / 2) {
    table.report("to_hz", "is " + shortest(*to_hz) + " but must lie below half the sample rate, " +
                              shortest(half_rate_hz) + " Hz");
  } else if (lines_of(lines).count > kMostMultisineLines) {
    table.report(
        table.has("ratio") ? "ratio" : "to_hz",
        "makes more than " + std::to_string(kMostMultisineLines) + " lines: a larger ratio makes fewer");
  }
  return lines;
}

void read_multisines(StrictTable& axis, const EventPlace& place, std::vector<AxisEvent>& events) {
  for (StrictTable& table : axis.tables("multisine", kMaxAxisEvents)) {
    const EventTime time = read_event_time(table, place);
    const auto load_nm = table.real("load_nm", -kMaxMultisineAmplitude, kMaxMultisineAmplitude);
    const auto offset_a = table.real("current_offset_a", -kMaxMultisineAmplitude, kMaxMultisineAmplitude);
    if (table.has("load_nm") == table.has("current_offset_a")) {
      table.report("load_nm",
                   "or else current_offset_a must stand in a multisine, with the amplitude of each line");
    }
    const auto periods = table.integer("periods", 1, kMostMultisinePeriods);
    table.require("periods");
    const MultisineLines lines = read_lines(table, place);
    table.finish();
    events.push_back({.tick = time.tick,
                      .action = Multisine{.quantity = load_nm ? Multisine::Quantity::kLoad
                                                              : Multisine::Quantity::kCurrentOffset,
                                          .periods = static_cast<std::uint32_t>(periods.value_or(1)),
                                          .amplitude = load_nm.value_or(offset_a.value_or(0.0)),
                                          .lines = lines},
                      .trigger = time.trigger});
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
  return std::holds_alternative<ShaftBump>(action) ? 4 : 5;
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
  read_multisines(axis, place, events);
  return in_order(std::move(events));
}

}  // namespace drivebench
