#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <tuple>

#include "plant/axis_state.hpp"
#include "protocols/signals/sample.hpp"
#include "server/bench/digest.hpp"
#include "server/bench/input.hpp"
#include "server/bench/safe_action.hpp"

namespace drivebench {

/// The control state of an axis, as in Sample.state. Only a clear by the controller ends timeout and fault;
/// it leads to idle.
enum class ControlState : std::uint64_t {
  kIdle = 0,     ///< no commands arrive: safe action
  kReady = 5,    ///< the first commands arrive, fewer than arming_commands: still safe action
  kRun = 1,      ///< commands arrive and drive the axis
  kHold = 2,     ///< commands are missing, the last one holds
  kTimeout = 3,  ///< latched: too many were missing, or the controller left; safe action
  kFault = 4,    ///< latched: trip, overrun or divergence; safe action
};

/// Whether commands drive the axis; if one is missing, the last one does.
constexpr bool is_driven(ControlState state) noexcept {
  return state == ControlState::kRun || state == ControlState::kHold;
}

/// The state in which these latched faults leave an axis, at least one.
constexpr ControlState state_with(std::uint64_t latched) noexcept {
  return (latched & ~(kCommandTimeout | kLeaseLost)) != 0 ? ControlState::kFault : ControlState::kTimeout;
}

/// The state of the control of an axis. 8-byte members only.
struct Control {
  Owner owner = 0;
  Tick renewed = 0;  ///< tick of the last renewal of the lease
  ControlState state = ControlState::kIdle;
  std::int64_t fresh = 0;  ///< 1: a command for this tick has arrived
  Command newest{};        ///< the last command accepted
  Command in_force{};
  std::int64_t silent_ticks = 0;   ///< ticks without a command, late ones not counted
  std::int64_t good_commands = 0;  ///< accepted ones in a row, until the axis is armed
  std::int64_t bad_values = 0;     ///< 1: the controller's last command was refused for its values
  std::uint64_t flags = 0;         ///< fault bits of the command in force
  LastCommands last{};
  std::uint64_t missed = 0;
  std::uint64_t refused = 0;
};
/// The edges of a command that stands at this byte of its block.
constexpr WordRange edges_of_command_at(std::size_t byte) noexcept {
  return {.first = (byte + offsetof(PhaseCommand, edges)) / 8, .count = sizeof(LegEdges) / 8};
}

template <>
inline constexpr auto kLaterWords<Control> = std::to_array<WordRange>(
    {edges_of_command_at(offsetof(Control, newest) + offsetof(Command, phases)),
     edges_of_command_at(offsetof(Control, in_force) + offsetof(Command, phases)),
     edges_of_command_at(offsetof(Control, last) + offsetof(LastCommands, command))});

template <>
inline constexpr auto kLaterWords<Sample> = [] {
  std::array<WordRange, kLaterSampleGroups.size()> ranges{};
  std::size_t end = kSampleWords;
  for (std::size_t n = ranges.size(); n-- > 0; end = kLaterSampleGroups[n])
    ranges[n] = {.first = kLaterSampleGroups[n], .count = end - kLaterSampleGroups[n]};
  return ranges;
}();

template <>
inline constexpr auto kLaterWords<AxisState> = [] {
  constexpr std::size_t kCommands = std::tuple_size_v<decltype(DriveMemory::commands)>;
  std::array<WordRange, kCommands + 8> ranges{};
  for (std::size_t n = 0; n < kCommands; ++n) {
    ranges[n] = edges_of_command_at(offsetof(AxisState, drive) + offsetof(DriveMemory, commands) +
                                    n * sizeof(PhaseCommand));
  }
  constexpr std::size_t kGateDriver = offsetof(InjectedFaults, gate_driver_fault);
  ranges[kCommands] = {.first = (offsetof(AxisState, injected) + kGateDriver) / 8, .count = 1};
  ranges[kCommands + 1] = {.first = offsetof(AxisState, terminal_v) / 8,
                           .count = (offsetof(AxisState, comparators) - offsetof(AxisState, terminal_v)) / 8};
  ranges[kCommands + 2] = {.first = offsetof(AxisState, comparators) / 8,
                           .count = sizeof(ComparatorMemory) / 8};
  ranges[kCommands + 3] = {.first = offsetof(AxisState, break_input) / 8, .count = sizeof(BreakMemory) / 8};
  ranges[kCommands + 4] = {.first = offsetof(AxisState, shunts) / 8, .count = sizeof(ShuntMemory) / 8};
  ranges[kCommands + 5] = {.first = offsetof(AxisState, absolute) / 8, .count = sizeof(AbsoluteMemory) / 8};
  ranges[kCommands + 6] = {.first = offsetof(AxisState, hall) / 8, .count = sizeof(HallMemory) / 8};
  ranges[kCommands + 7] = {.first = offsetof(AxisState, bootstrap) / 8, .count = sizeof(BootstrapMemory) / 8};
  return ranges;
}();

}  // namespace drivebench
