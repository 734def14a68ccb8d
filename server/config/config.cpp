#include "server/config/config.hpp"

#include <arpa/inet.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "plant/faults.hpp"
#include "protocols/text.hpp"
#include "server/config/sections/events.hpp"
#include "server/config/words.hpp"

namespace drivebench {
std::string in_quotes(std::string_view text) {
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') result += '\\';
    result += c;
  }
  return result + '"';
}

std::string real_text(double value) {
  std::string text = shortest(value);
  return text.find_first_of(".e") == std::string::npos ? text + ".0" : text;
}

std::string_view name_of(RunMode mode) noexcept {
  return kRunModeWords[static_cast<std::size_t>(mode)];
}

std::string_view name_of(PacerKind pacer) noexcept {
  return kPacerWords[static_cast<std::size_t>(pacer)];
}

void change_mode(BenchConfig& config, RunMode mode) noexcept {
  BenchSetup& setup = config.setup;
  if (setup.arming_commands == default_arming_commands(config.mode)) {
    setup.arming_commands = default_arming_commands(mode);
  }
  if (mode == RunMode::kRealtime) setup.command_delay_ticks = 1;
  config.mode = mode;
}

ChangeView change_view(const BenchConfig& config, std::size_t axis, const AxisParameters& in_force,
                       Tick tick) noexcept {
  const auto name = [&config](std::optional<std::size_t> other) {
    return other ? std::string_view(config.axes[*other].name) : std::string_view();
  };
  const std::vector<AxisSetup>& axes = config.setup.axes;
  return {.parameters = in_force,
          .shaft_of = name(axes[axis].shares_shaft_with),
          .amplifier_of = name(axes[axis].shares_amplifier_with),
          .drives_another = std::ranges::any_of(
              axes, [axis](const AxisSetup& other) { return other.shares_amplifier_with == axis; }),
          .tick = tick};
}

namespace {

/// The names of these latched faults, behind a sentence.
std::string latched_names(std::uint64_t latched) {
  std::string names;
  for (const FaultInfo& fault : kFaultTable) {
    if ((latched & fault.bit) != 0) names.append(names.empty() ? ": " : " ").append(fault.name);
  }
  return names;
}

}  // namespace

std::string sentence_of(Refused why, const BenchConfig& config, std::size_t axis, std::uint64_t latched) {
  if (why == Refused::kLatched) return std::string(sentence_of(why)) + latched_names(latched);
  const std::optional<std::size_t> owner =
      axis < config.axes.size() ? config.setup.axes[axis].shares_amplifier_with : std::nullopt;
  if (why != Refused::kSharedAmplifier || !owner) return std::string(sentence_of(why));
  const std::string& other = config.axes[*owner].name;
  return "axis " + config.axes[axis].name + " takes the voltages of axis " + other +
         ", whose amplifier it shares: lease, commands and drive are those of " + other;
}

std::vector<std::string> axis_names(const BenchConfig& config) {
  std::vector<std::string> names;
  for (const AxisConfig& axis : config.axes)
    names.push_back(axis.name);
  return names;
}

namespace {

template <class See>
void each_event(const BenchConfig& config, See see) {
  for (std::uint32_t axis = 0; axis < config.axes.size(); ++axis) {
    for (const AxisEvent& event : config.axes[axis].events)
      see(event, Input{.tick = event.tick, .axis = axis, .owner = 0, .action = event.action});
  }
}

}  // namespace

void await_events(const BenchConfig& config, Bench& bench) {
  each_event(config, [&bench](const AxisEvent& event, const Input& input) {
    if (event.trigger) bench.await(*event.trigger, input);
  });
}

void schedule_events(const BenchConfig& config, Bench& bench) {
  await_events(config, bench);
  each_event(config, [&bench](const AxisEvent& event, const Input& input) {
    if (!event.trigger) bench.submit(input);
  });
}

std::vector<EventState> event_states(const BenchConfig& config, const Bench& bench) {
  const std::vector<std::string> names = axis_names(config);
  std::vector<EventState> states;
  std::size_t awaited = 0;
  for (std::size_t axis = 0; axis < config.axes.size(); ++axis) {
    for (const AxisEvent& event : config.axes[axis].events) {
      const Tick triggered = event.trigger ? bench.triggered_at(awaited++) : 0;
      const Tick acts = triggered + event.tick;
      states.push_back(
          {.axis = axis,
           .text = event_text(event, config.setup.axes[axis].parameters, {.axis = axis, .names = names}),
           .acted = triggered >= 0 && acts < bench.tick() ? std::optional(acts) : std::nullopt});
    }
  }
  return states;
}

std::string_view name_of(SafeAction action) noexcept {
  return kSafeActionWords[static_cast<std::size_t>(action)];
}

bool is_address(const std::string& text) noexcept {
  in_addr v4{};
  in6_addr v6{};
  return text == "localhost" || ::inet_pton(AF_INET, text.c_str(), &v4) == 1 ||
         ::inet_pton(AF_INET6, text.c_str(), &v6) == 1;
}

bool is_loopback(const std::string& address) noexcept {
  in_addr v4{};
  in6_addr v6{};
  if (address == "localhost") return true;
  if (::inet_pton(AF_INET, address.c_str(), &v4) == 1) return ntohl(v4.s_addr) >> 24 == 127;
  return ::inet_pton(AF_INET6, address.c_str(), &v6) == 1 && IN6_IS_ADDR_LOOPBACK(&v6);
}

std::uint32_t sessions_of_address(const TcpConfig& tcp) noexcept {
  const std::uint32_t share = is_loopback(tcp.address) ? tcp.max_sessions : (tcp.max_sessions + 1) / 2;
  return tcp.max_sessions_of_address.value_or(share);
}

bool is_multicast(const std::string& address) noexcept {
  in_addr v4{};
  in6_addr v6{};
  if (::inet_pton(AF_INET, address.c_str(), &v4) == 1) return ntohl(v4.s_addr) >> 28 == 0xE;
  return ::inet_pton(AF_INET6, address.c_str(), &v6) == 1 && IN6_IS_ADDR_MULTICAST(&v6);
}

}  // namespace drivebench
