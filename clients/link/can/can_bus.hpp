#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "clients/link/can/can_address.hpp"
#include "protocols/can/frame.hpp"

namespace drivebench::link {

/// A connection to a CAN bus on blocking calls, for one thread. Throws LinkError when the bus fails.
class CanBus {
 public:
  using Clock = std::chrono::steady_clock;

  CanBus() = default;
  CanBus(const CanBus&) = delete;
  CanBus& operator=(const CanBus&) = delete;
  virtual ~CanBus() = default;

  virtual void send(const can::Frame& frame) = 0;
  /// The next frame of another node, perhaps an error frame; nothing if none comes in time or a signal does.
  /// With a time that is past it gives only a frame that has come already.
  virtual std::optional<can::Frame> receive(Clock::time_point until) = 0;
};

/// Opens the bus. With identifiers, a kernel filter passes only data frames with these, if the back end
/// supports it. Throws ConnectError.
std::unique_ptr<CanBus> open_can_bus(const CanAddress& address, std::chrono::milliseconds deadline,
                                     std::span<const std::uint32_t> ids = {});

}  // namespace drivebench::link
