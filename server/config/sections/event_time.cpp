#include "server/config/sections/event_time.hpp"

#include <algorithm>
#include <initializer_list>
#include <string_view>
#include <variant>

#include "protocols/text.hpp"
#include "server/config/sections/axis.hpp"

namespace drivebench {
namespace {

constexpr std::size_t kLongestCondition = 200;  ///< [bytes]

/// Reports each of the keys that the table has.
void refuse(StrictTable& table, std::initializer_list<std::string_view> keys, const std::string& why) {
  for (const std::string_view key : keys) {
    if (!table.has(key)) continue;
    table.node(key);
    table.report(key, why);
  }
}

std::optional<Trigger> read_trigger(StrictTable& table, const EventPlace& place) {
  const auto text = table.text("when", kLongestCondition);
  const auto for_ticks = read_ticks(table, "for_s", "for_ticks", place.period_ns);
  if (!text) return std::nullopt;
  const auto parsed = parse_condition(*text);
  const auto report = [&](const std::string& why) {
    table.report("when", "is \"" + printable(*text) + "\" but " + why);
    return std::nullopt;
  };
  if (const auto* why = std::get_if<std::string>(&parsed)) return report(*why);
  const NamedCondition& named = std::get<NamedCondition>(parsed);
  const auto name = std::ranges::find(place.names, named.axis);
  if (!named.axis.empty() && name == place.names.end()) {
    return report("the bench has no axis '" + printable(named.axis) + "'");
  }
  const auto axis = named.axis.empty() ? place.axis : static_cast<std::size_t>(name - place.names.begin());
  return Trigger{.axis = static_cast<std::uint32_t>(axis),
                 .condition = named.condition,
                 .for_ticks = for_ticks.value_or(0)};
}

}  // namespace

EventTime read_event_time(StrictTable& table, const EventPlace& place) {
  if (table.node("when") == nullptr) {
    refuse(table, {"for_s", "for_ticks", "delay_s", "delay_ticks"}, "belongs to when, which is missing");
    const auto tick = read_ticks(table, "at_s", "at_tick", place.period_ns);
    if (!table.has("at_tick")) table.require("at_s");
    return {.tick = tick.value_or(0)};
  }
  refuse(table, {"at_s", "at_tick"}, "cannot stand beside when: delay_s counts from the trigger on");
  const std::optional<Trigger> trigger = read_trigger(table, place);
  const auto delay = read_ticks(table, "delay_s", "delay_ticks", place.period_ns);
  return {.tick = delay.value_or(0), .trigger = trigger};
}

std::optional<EventTime> read_event_end(StrictTable& table, const EventTime& begin, std::int64_t period_ns) {
  if (table.has("when")) {
    refuse(table, {"until_s", "until_tick"}, "cannot stand beside when: lasts_s counts from the begin on");
    const auto lasts = read_ticks(table, "lasts_s", "lasts_ticks", period_ns);
    if (!lasts) return std::nullopt;
    if (*lasts == 0) {
      table.report(table.has("lasts_s") ? "lasts_s" : "lasts_ticks",
                   "comes to 0 ticks but must come to at least 1");
    }
    return EventTime{.tick = begin.tick + *lasts, .trigger = begin.trigger};
  }
  refuse(table, {"lasts_s", "lasts_ticks"},
         "belongs to when, which is missing: until_s ends a fault that begins at_s");
  const auto until = read_ticks(table, "until_s", "until_tick", period_ns);
  if (!until) return std::nullopt;
  if (*until <= begin.tick) {
    table.report(table.has("until_s") ? "until_s" : "until_tick",
                 "comes to tick " + std::to_string(*until) + " but must lie after tick " +
                     std::to_string(begin.tick) + ", where the fault begins");
  }
  return EventTime{.tick = *until};
}

}  // namespace drivebench
