#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

namespace drivebench::command {

/// The bit timing of a CAN controller in one phase of a frame.
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

/// Properties that only drivers of real hardware report.
struct CanController {
  CanControllerState state = CanControllerState::kStopped;
  std::optional<CanBitTiming> timing;
  std::optional<CanBitTiming> data_timing;  ///< of the fast phase of FD frames
  bool fd = false;
  bool listen_only = false;
  bool one_shot = false;
  std::uint32_t restart_ms = 0;  ///< 0: stays off the bus after bus-off
};

/// The properties of a network interface that `drivebench can check` needs.
struct CanInterface {
  std::string name;
  bool is_can = false;
  std::string kind;  ///< "vcan", "can", "slcan"...; empty: the driver does not say
  bool up = false;
  std::uint32_t mtu = 0;
  std::uint32_t queue_length = 0;
  std::optional<CanController> controller;
};

/// Reads an interface from the kernel; nothing if it does not exist. Throws std::system_error if the kernel
/// does not answer.
std::optional<CanInterface> read_can_interface(const std::string& name);

/// Parses a message of type RTM_NEWLINK with its header; nothing for any other message.
std::optional<CanInterface> parse_link_message(std::span<const std::byte> message);

}  // namespace drivebench::command
