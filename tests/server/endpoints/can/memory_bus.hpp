#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "server/endpoints/can/buses/bus.hpp"
#include "server/host/asio.hpp"

namespace drivebench::can {

class MemoryBus;

/// A bus inside this process that can have the faults of a real one. Every port receives the frames of the
/// others in the order of sending, always from the io_context and never from inside send().
class MemoryWire {
 public:
  explicit MemoryWire(asio::io_context& io) : io_(io) {}
  MemoryWire(const MemoryWire&) = delete;
  MemoryWire& operator=(const MemoryWire&) = delete;
  ~MemoryWire();

  /// A port; must not outlive the wire.
  std::unique_ptr<Bus> connect(std::string name);

  /// kDown and kAbsent: sent frames and those under way are lost; kUp: the bus works again.
  void set_link(BusState state);
  /// No room for any frame: ports keep the newest of each identifier until there is room again.
  void set_full(bool full);
  /// The next frames are lost; the ports learn of it with the first frame that comes through.
  void lose(std::uint64_t frames) { to_lose_ += frames; }
  /// Sends an error frame of the CAN controller (linux/can/error.h) to every port. Bus-off lasts until
  /// set_link(kUp).
  void report(Frame error);

 private:
  friend class MemoryBus;

  struct Passage {
    const MemoryBus* from;
    Frame frame;
  };

  void carry(const MemoryBus* from, const Frame& frame);
  void deliver();

  asio::io_context& io_;
  std::vector<MemoryBus*> ports_;
  std::vector<Passage> under_way_;
  bool posted_ = false;  ///< deliver() is posted
  BusState link_ = BusState::kUp;
  bool full_ = false;
  std::uint64_t to_lose_ = 0;
  std::shared_ptr<const bool> alive_ =
      std::make_shared<const bool>();  ///< for handlers that outlive the object
};

}  // namespace drivebench::can
