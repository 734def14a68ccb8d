#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "server/endpoints/can/buses/bus.hpp"
#include "server/host/asio.hpp"

namespace drivebench::can {

/// The common part of buses without a CAN interface of the kernel: opening again, filter, counters.
class VirtualBus : public Bus {
 public:
  VirtualBus(asio::io_context& io, const CanConfig& config) : io_(io), config_(config), retry_(io) {}

  /// Opens the bus. If that fails, a required bus throws std::runtime_error; any other tries again later.
  void start();

  void set_filter(const std::vector<std::uint32_t>& ids) override;
  const BusStatus& status() const noexcept override { return status_; }

 protected:
  /// Opens the transport. Returns the problem with its cure; empty: none.
  virtual std::string open() = 0;

  /// To be called after the transport is lost: opens it again as soon as possible.
  void lost(const std::string& why);
  /// Counts a frame from the transport and passes it on.
  void deliver(const Frame& frame, std::int64_t stamp_ns);
  /// To be called when a client of the bus is refused or cut off.
  void refused(const std::string& peer, std::string_view why) const {
    if (on_refused) on_refused(peer, why);
  }
  bool is_up() const noexcept { return status_.state == BusState::kUp; }
  /// For handlers, which may run after the end of the bus.
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

/// The text of errno.
std::string reason();
/// Seconds since 1970, for formats whose frames carry the time.
double realtime_s();
/// Gives the descriptor to Asio; closes it if that fails.
bool adopt(asio::posix::stream_descriptor& stream, int fd);

}  // namespace drivebench::can
