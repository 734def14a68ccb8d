#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "server/endpoints/can/buses/bus.hpp"
#include "server/host/asio.hpp"

namespace drivebench::can {

/// What the buses without a CAN interface of the kernel have in common: opening again, filter, counters.
class VirtualBus : public Bus {
 public:
  VirtualBus(asio::io_context& io, const CanConfig& config) : io_(io), config_(config), retry_(io) {}

  /// Opens it. Throws std::runtime_error if that fails and the bus is required; otherwise tries again later.
  void start();

  void set_filter(const std::vector<std::uint32_t>& ids) override;
  const BusStatus& status() const noexcept override { return status_; }

 protected:
  /// Opens the transport; what hinders it, with the cure, or nothing.
  virtual std::string open() = 0;

  /// To be called when the transport has gone: opens it again as soon as it is there.
  void lost(const std::string& why);
  /// Counts a frame from the transport and passes it on.
  void deliver(const Frame& frame, std::int64_t stamp_ns);
  /// To be called when a client of the bus is turned away or cut off.
  void refused(const std::string& peer, std::string_view why) const {
    if (on_refused) on_refused(peer, why);
  }
  bool is_up() const noexcept { return status_.state == BusState::kUp; }
  /// For handlers, which may run when the bus is gone.
  std::weak_ptr<const bool> alive() const { return alive_; }

  asio::io_context& io_;
  CanConfig config_;
  BusStatus status_;

 private:
  void try_later();
  void set_state(BusState state);

  ServerTimer retry_;
  bool filtered_ = false;
  std::vector<std::uint32_t> filter_;  // sorted
  std::shared_ptr<const bool> alive_ = std::make_shared<const bool>();
};

/// What errno says.
std::string reason();
/// Seconds since 1970, for formats whose frames carry the time.
double realtime_s();
/// Gives the descriptor to Asio; closes it if that fails.
bool adopt(asio::posix::stream_descriptor& stream, int fd);

}  // namespace drivebench::can
