#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/can/frame.hpp"
#include "server/config/config.hpp"

namespace boost::asio {
class io_context;
}

namespace drivebench::can {

/// State of a bus.
enum class BusState : std::uint8_t { kUp, kWarning, kPassive, kDown, kAbsent };

/// State and counters of a back end.
struct BusStatus {
  BusState state = BusState::kAbsent;
  std::uint64_t sent = 0;
  std::uint64_t confirmed = 0;  ///< frames seen on the bus, where the back end reports them
  std::uint64_t received = 0;
  std::uint64_t send_dropped = 0;     ///< replaced by a newer frame with the same identifier, or given up
  std::uint64_t receive_dropped = 0;  ///< lost before the bench read them, as far as the system reports it
  std::uint64_t error_frames = 0;
  std::uint64_t malformed = 0;  ///< bytes from the transport that were no frame
};

/// One connection to a CAN bus, on the I/O thread. After the constructor no method waits or throws.
class Bus {
 public:
  virtual ~Bus() = default;

  /// Sends a frame, or keeps it until the transport has room: at most one per identifier, the newest.
  virtual void send(const Frame& frame) = 0;
  /// Sends several frames in this order, in one system call where the back end can.
  virtual void send_together(std::span<const Frame> frames) {
    for (const Frame& frame : frames)
      send(frame);
  }
  /// The bus needs to deliver only data and remote frames with these identifiers, of 11 and of 29 bits, so
  /// that look-alikes can be counted; the kernel filters where it can.
  virtual void set_filter(const std::vector<std::uint32_t>& ids) = 0;
  virtual const BusStatus& status() const noexcept = 0;
  /// Back end and channel, for people: "socketcan:vcan0".
  virtual std::string name() const = 0;

  /// Called with each data or remote frame of another sender, never with error frames. `stamp_ns` is the time
  /// of its arrival on CLOCK_REALTIME by the kernel, or 0.
  std::function<void(const Frame& frame, std::int64_t stamp_ns)> on_frame;
  /// Called after status().state has changed.
  std::function<void()> on_state;
  /// Called by back ends with clients when they refuse a client or cut it off, with its address and the
  /// reason.
  std::function<void(const std::string& peer, std::string_view why)> on_refused;
};

/// Opens the bus that the configuration names. Throws std::runtime_error that names the interface if a
/// required bus cannot be opened; the other buses try again until they open.
std::unique_ptr<Bus> open_bus(boost::asio::io_context& io, const CanConfig& config);

}  // namespace drivebench::can
