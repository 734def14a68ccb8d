#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

namespace drivebench::link {

/// How a CAN controller samples bits, in one phase of a frame.
struct CanBitTiming {
  std::uint32_t bit_rate = 0;
  double sample_point = 0.0;  ///< fraction of a bit
  std::uint32_t sjw = 0;      ///< synchronisation jump width, time quanta
  std::uint32_t quanta = 0;   ///< time quanta a bit
  double quantum_ns = 0.0;
};

enum class CanControllerState : std::uint8_t {
  kErrorActive,
  kErrorWarning,
  kErrorPassive,
  kBusOff,
  kStopped,
  kSleeping
};

/// What a driver of real hardware tells beside it.
struct CanController {
  CanControllerState state = CanControllerState::kStopped;
  std::optional<CanBitTiming> timing;
  std::optional<CanBitTiming> data_timing;  ///< of the fast phase of FD frames
  bool fd = false;
  bool listen_only = false;
  bool one_shot = false;
  std::uint32_t restart_ms = 0;                  ///< 0: stays off the bus after bus-off
  std::optional<std::uint16_t> transmit_errors;  ///< the controller's counters, if the driver reads them
  std::optional<std::uint16_t> receive_errors;
  std::uint32_t bus_offs = 0;
  std::uint32_t arbitration_lost = 0;
  std::uint32_t bus_errors = 0;
};

/// A network interface, as the kernel describes it.
struct CanInterface {
  std::string name;
  bool is_can = false;
  std::string kind;  ///< "vcan", "can", "slcan"...; empty: the driver does not say
  bool up = false;
  std::uint32_t mtu = 0;
  std::uint32_t queue_length = 0;
  std::uint64_t receive_packets = 0;
  std::uint64_t transmit_packets = 0;
  std::uint64_t receive_errors = 0;
  std::uint64_t transmit_errors = 0;
  std::uint64_t receive_dropped = 0;
  std::uint64_t transmit_dropped = 0;
  std::optional<CanController> controller;
};

/// Asks the kernel; nothing if there is no such interface. Throws std::system_error if it does not answer.
std::optional<CanInterface> read_can_interface(const std::string& name);

/// Reads a message of type RTM_NEWLINK, header and all; nothing if it is none.
std::optional<CanInterface> parse_link_message(std::span<const std::byte> message);

}  // namespace drivebench::link
