#pragma once

#include <linux/can.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "server/endpoints/can/buses/bus.hpp"
#include "server/endpoints/can/buses/send_queue.hpp"
#include "server/host/asio.hpp"

struct mmsghdr;

namespace drivebench::can {

/// A CAN interface of the kernel, through a raw socket. Needs no privileges.
class SocketCanBus final : public Bus {
 public:
  /// Throws std::runtime_error with the cure if the interface is missing or cannot carry the configured
  /// frames and is required. An interface that is down is not missing.
  /// `confirm_virtual` asks for confirmations on virtual interfaces too, where they cost a wake-up for each
  /// frame and mean little.
  SocketCanBus(asio::io_context& io, const CanConfig& config, bool confirm_virtual = false);

  void send(const Frame& frame) override;
  void send_together(std::span<const Frame> frames) override;
  void set_filter(const std::vector<std::uint32_t>& ids) override;
  const BusStatus& status() const noexcept override { return status_; }
  std::string name() const override { return "socketcan:" + config_.channel; }

 private:
  enum class Sent : std::uint8_t { kYes, kFull, kLost };

  /// Opens and binds a socket. Returns the problem with its cure; empty: none.
  std::string open();
  std::string interface_problem(int fd) const;
  void set_options(int fd);
  void set_buffer(int fd);
  void apply_filter(int fd) const;
  void close();
  void set_state(BusState state);

  void wait();
  void read();
  void take(const mmsghdr& message, const canfd_frame& raw);
  void fail(int error);
  void go_down();

  bool is_off() const noexcept {
    return status_.state == BusState::kDown || status_.state == BusState::kAbsent;
  }
  Sent transmit(const Frame& frame);
  void flush();
  void retry_later();
  void probe_later();
  void probe();

  asio::io_context& io_;
  CanConfig config_;
  bool confirm_virtual_;
  BusStatus status_;
  asio::posix::stream_descriptor stream_;
  ServerTimer retry_;
  ServerTimer probe_;
  SendQueue pending_;  ///< frames for which the interface had no room
  std::vector<can_filter> filter_;
  bool filtered_ = false;
  int index_ = 0;                  ///< of the interface that the socket is bound to
  std::uint32_t lost_before_ = 0;  ///< the socket's count of lost frames at the last look
  std::string problem_;            ///< the last one in the log
  std::shared_ptr<const bool> alive_ =
      std::make_shared<const bool>();  ///< for handlers that outlive the object
};

}  // namespace drivebench::can
