#pragma once

#include <cstdint>

/// The state machine of control word and status word from CiA 402 (IEC 61800-7-201).
namespace drivebench::modbus {

enum class DriveState : std::uint8_t {
  kSwitchOnDisabled,
  kReadyToSwitchOn,
  kSwitchedOn,
  kOperationEnabled,
  kQuickStopActive,
  kFault,
};

/// Bits of the control word.
inline constexpr std::uint16_t kSwitchOn = 1 << 0;
inline constexpr std::uint16_t kEnableVoltage = 1 << 1;
inline constexpr std::uint16_t kNoQuickStop = 1 << 2;
inline constexpr std::uint16_t kEnableOperation = 1 << 3;
inline constexpr std::uint16_t kFaultReset = 1 << 7;

/// The state after a write of the control word. Only a fault reset leaves the state Fault; the caller handles
/// it.
constexpr DriveState next_state(DriveState state, std::uint16_t control_word) noexcept {
  using enum DriveState;
  if (state == kFault) return kFault;
  if ((control_word & kEnableVoltage) == 0) return kSwitchOnDisabled;
  if ((control_word & kNoQuickStop) == 0) {
    return state == kOperationEnabled || state == kQuickStopActive ? kQuickStopActive : kSwitchOnDisabled;
  }
  if ((control_word & kSwitchOn) == 0) return state == kQuickStopActive ? state : kReadyToSwitchOn;
  // Only a "shutdown", the line above, leads out of this state: an old word with other bits enables nothing.
  if (state == kSwitchOnDisabled) return state;
  if ((control_word & kEnableOperation) != 0) return kOperationEnabled;
  return state == kQuickStopActive ? state : kSwitchedOn;
}

/// The bits of the status word beside the state.
struct StatusFlags {
  bool voltage_present;
  bool warning;
  bool remote;
  bool limit;
};

constexpr std::uint16_t status_word(DriveState state, const StatusFlags& flags) noexcept {
  constexpr std::uint16_t kStates[] = {0x40, 0x21, 0x23, 0x27, 0x07, 0x08};
  unsigned word = kStates[static_cast<unsigned>(state)];
  if (flags.voltage_present) word |= 1u << 4;
  if (flags.warning) word |= 1u << 7;
  if (flags.remote) word |= 1u << 9;
  if (flags.limit) word |= 1u << 11;
  return static_cast<std::uint16_t>(word);
}

}  // namespace drivebench::modbus
