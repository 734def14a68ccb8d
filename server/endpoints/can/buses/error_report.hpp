#pragma once

#include <linux/can/error.h>

#include "server/endpoints/can/buses/bus.hpp"

namespace drivebench::can {

/// The state of the CAN controller after an error frame (linux/can/error.h).
inline BusState state_after(const Frame& error, BusState before) noexcept {
  if ((error.id & CAN_ERR_BUSOFF) != 0) return BusState::kDown;
  if ((error.id & CAN_ERR_RESTARTED) != 0) return BusState::kUp;
  if ((error.id & CAN_ERR_CRTL) == 0 || before == BusState::kDown) return before;
  const std::uint8_t controller = error.data[1];
  if ((controller & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0) return BusState::kPassive;
  if ((controller & (CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING)) != 0) return BusState::kWarning;
  if ((controller & CAN_ERR_CRTL_ACTIVE) != 0) return BusState::kUp;
  return before;
}

}  // namespace drivebench::can
