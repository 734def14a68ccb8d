#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

namespace drivebench::command {

/// How a CAN controller samples bits, in one phase of a frame.
struct CanBitTiming {
  std::uint32_t bit_rate = 0;
  double sample_point = 0.0;  ///< fraction of a bit
  std::uint32_t sjw = 0;      ///< synchronisation jump width, time quanta
  std::uint32_t quanta = 0;   ///< time quanta a bit
};

enum class CanControllerState : std::uint8_t {
  kErrorActive,
  kErrorWarning,
  kErrorPassive,
  kBusOff,
  kStopped,
  kSleeping
};

/// What only a driver of real hardware tells.
struct CanController {
  CanControllerState state = CanControllerState::kStopped;
  std::optional<CanBitTiming> timing;
  std::optional<CanBitTiming> data_timing;  ///< of the fast phase of FD frames
  bool fd = false;
  bool listen_only = false;
  bool one_shot = false;
  std::uint32_t restart_ms = 0;  ///< 0: stays off the bus after bus-off
};

/// Of a network interface what `drivebench can check` judges.
struct CanInterface {
  std::string name;
  bool is_can = false;
  std::string kind;  ///< "vcan", "can", "slcan"...; empty: the driver does not say
  bool up = false;
  std::uint32_t mtu = 0;
  std::uint32_t queue_length = 0;
  std::optional<CanController> controller;
};

/// Asks the kernel; nothing if there is no such interface. Throws std::system_error if it does not answer.
std::optional<CanInterface> read_can_interface(const std::string& name);

/// Reads a message of type RTM_NEWLINK, header and all; nothing if it is none.
std::optional<CanInterface> parse_link_message(std::span<const std::byte> message);

}  // namespace drivebench::command
