#include <string_view>

#include "plant/parameters/parameters.hpp"
#include "protocols/text.hpp"
#include "server/config/sections/events.hpp"
#include "server/config/sections/parameters.hpp"
#include "server/config/words.hpp"

namespace drivebench {
namespace {

/// With the name of its axis, unless that is the event's own.
std::string condition_text(const Trigger& trigger, const EventPlace& place) {
  const std::string text = text_of(trigger.condition);
  return trigger.axis == place.axis ? text : place.names[trigger.axis] + "." + text;
}

std::string_view amplitude_key(Multisine::Quantity quantity) {
  return quantity == Multisine::Quantity::kLoad ? "load_nm" : "current_offset_a";
}

/// Writes an event as a table.
struct EventWriter {
  std::string& text;
  const AxisParameters& p;
  const AxisEvent& event;
  const EventPlace& place;

  void line(std::string_view key, const std::string& value) const {
    text.append(key).append(" = ").append(value).append("\n");
  }
  void begin(std::string_view kind) const {
    text.append("\n[[axis.").append(kind).append("]]\n");
    if (!event.trigger) return line("at_tick", std::to_string(event.tick));
    line("when", in_quotes(condition_text(*event.trigger, place)));
    line("for_ticks", std::to_string(event.trigger->for_ticks));
    line("delay_ticks", std::to_string(event.tick));
  }
  void operator()(const LoadChange& load) const {
    begin("load");
    line("load_nm", real_text(load.load_nm));
    line("ramp_ticks", std::to_string(load.ramp_ticks));
  }
  void operator()(const ParameterWrite& write) const {
    const Parameter& row = axis_parameters(p)[write.row];
    begin("set");
    line("parameter", in_quotes(row.name));
    line("value", value_text(row, write.value));
    line("ramp_ticks", std::to_string(write.ramp_ticks));
  }
  void operator()(const InjectFault& fault) const {
    begin("fault");
    line("name", in_quotes(kInjectableFaults[fault.row].name));
    line("value", real_text(fault.value));
  }
  void operator()(const ShaftBump& bump) const {
    begin("bump");
    line("impulse_nms", real_text(bump.impulse_nms));
  }
  void operator()(const Multisine& m) const {
    begin("multisine");
    line(amplitude_key(m.quantity), real_text(m.amplitude));
    line("period_ticks", std::to_string(m.lines.period_ticks));
    line("periods", std::to_string(m.periods));
    line("from_hz", real_text(frequency_hz(m.lines.lowest, m.lines)));
    line("to_hz", real_text(frequency_hz(m.lines.highest, m.lines)));
    line("ratio", real_text(m.lines.ratio));
  }
  double frequency_hz(std::uint32_t multiple, const MultisineLines& lines) const {
    return multiple / (static_cast<double>(lines.period_ticks) * static_cast<double>(place.period_ns) * 1e-9);
  }
  template <class Other>
  void operator()(const Other&) const {}  // a configuration has no other actions
};

std::string in_ramp(Tick ticks) {
  return ticks == 0 ? std::string() : " in a ramp of " + std::to_string(ticks) + " ticks";
}

/// An action in words.
struct ActionText {
  const AxisParameters& p;

  std::string operator()(const LoadChange& load) const {
    return "load " + shortest(load.load_nm) + " N*m" + in_ramp(load.ramp_ticks);
  }
  std::string operator()(const ParameterWrite& write) const {
    const Parameter& row = axis_parameters(p)[write.row];
    return std::string(row.name) + " = " + value_text(row, write.value) + in_ramp(write.ramp_ticks);
  }
  std::string operator()(const InjectFault& fault) const {
    return "fault " + std::string(kInjectableFaults[fault.row].name) + " = " + shortest(fault.value);
  }
  std::string operator()(const ShaftBump& bump) const {
    return "bump " + shortest(bump.impulse_nms) + " N*m*s";
  }
  std::string operator()(const Multisine& m) const {
    return "multisine of " + std::to_string(lines_of(m.lines).count) + " lines, " +
           std::string(amplitude_key(m.quantity)) + " = " + shortest(m.amplitude) + ", for " +
           std::to_string(m.periods) + " periods of " + std::to_string(m.lines.period_ticks) + " ticks";
  }
  template <class Other>
  std::string operator()(const Other&) const {
    return {};  // a configuration has no other actions
  }
};

}  // namespace

std::string events_text(const std::vector<AxisEvent>& events, const AxisParameters& p,
                        const EventPlace& place) {
  std::string text;
  for (const AxisEvent& event : events)
    std::visit(EventWriter{text, p, event, place}, event.action);
  return text;
}

std::string event_text(const AxisEvent& event, const AxisParameters& p, const EventPlace& place) {
  const std::string action = std::visit(ActionText{p}, event.action);
  if (!event.trigger) return action + " at tick " + std::to_string(event.tick);
  const std::string delay = event.tick == 0 ? " when " : " " + std::to_string(event.tick) + " ticks after ";
  const Tick held = event.trigger->for_ticks;
  return action + delay + condition_text(*event.trigger, place) +
         (held == 0 ? std::string() : " for " + std::to_string(held) + " ticks");
}

}  // namespace drivebench
