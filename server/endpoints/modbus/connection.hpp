#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/modbus/mbap.hpp"
#include "protocols/modbus/pdu.hpp"
#include "server/access/audit.hpp"
#include "server/endpoints/deadline.hpp"
#include "server/endpoints/log_limit.hpp"
#include "server/endpoints/modbus/axis_desk.hpp"
#include "server/endpoints/modbus/identification.hpp"
#include "server/endpoints/modbus/rate_limit.hpp"
#include "server/endpoints/modbus/reply_builder.hpp"
#include "server/host/asio.hpp"

namespace drivebench::modbus {

/// The parts that all connections share.
struct Shared {
  Engine& engine;
  ReplyBuilder& replies;
  RateLimit& rate;
  const Identification& identification;
  Audit* audit;                                  ///< null: no audit log is kept
  std::vector<std::unique_ptr<AxisDesk>> desks;  ///< by axis

  struct Counts {
    std::uint64_t requests = 0;
    std::uint64_t exceptions = 0;
    std::uint64_t refused_writes = 0;  ///< without the lease, latched, stale, or a wrong value
    std::uint64_t not_owner = 0;       ///< of these, those without the lease, which are no part of the run
    std::uint64_t throttled = 0;
    std::uint64_t cut = 0;  ///< connections: malformed frames, time-outs, floods, no free connection
    std::uint64_t turned_away = 0;
  } counts;
  LogLimit refused_writes_log;
  LogLimit cut_log;
  LogLimit turned_away_log;
  LogLimit takeover_log;
};

/// The connection of one client. It answers requests in their order; an error ends this connection and
/// nothing else.
class ClientConnection : public std::enable_shared_from_this<ClientConnection> {
 public:
  using Clock = ServerClock;

  ClientConnection(asio::ip::tcp::socket socket, Visitor number, Shared& shared);

  /// Reads and answers until the peer or an error ends the connection.
  asio::awaitable<void> run();
  /// After run(): its leases begin to lapse.
  void end();

  /// After a tick or a change of a lease: continues an exchange that waits for it.
  void wake() {
    if (waiting_) waker_.cancel();
  }
  void close() noexcept;
  /// Closes it with a reason for the log.
  void cut(std::string_view why);

  const asio::ip::address& peer() const noexcept { return peer_; }
  Visitor number() const noexcept { return number_; }
  /// A line in the audit log, if one is kept.
  void audit(std::string_view event, std::string_view why_not, std::optional<std::uint32_t> axis = {}) const;
  /// Address and port.
  std::string peer_name() const { return name_.substr(name_.find(' ') + 1); }
  bool has_lease() const noexcept;
  /// The time of its last request; now, while it waits for a tick.
  Clock::time_point idle_since() const noexcept { return waiting_ ? Clock::now() : last_request_; }

 private:
  using Bytes = std::span<const std::uint8_t>;

  /// Counts a peer that the kernel has given up as cut off.
  void note_loss(const boost::system::error_code& error);
  /// Closes the connection unless stopped in time.
  void start_timer();
  void stop_timer() {
    timing_ = false;
    timer_.call_off();
  }

  asio::awaitable<bool> answer(Bytes adu);
  asio::awaitable<void> execute(AxisDesk& desk, Bytes adu, Request request);
  asio::awaitable<Exception> carry_out_write(AxisDesk& desk, const Request& request);
  asio::awaitable<Exception> wait_for_tick(AxisDesk& desk, Tick before);
  /// Whether the peer has closed its end, with or without requests that were not read yet.
  bool is_peer_gone();
  void fill_reply(AxisDesk& desk, const Request& request);
  void note_refused_write(AxisDesk& desk, Refused why);
  AxisDesk* desk_of(std::uint8_t unit);
  void reply(Bytes adu, Bytes pdu);
  void refuse(Bytes adu, Exception exception);
  asio::awaitable<bool> flush();

  asio::ip::tcp::socket socket_;
  Visitor number_;
  Shared& shared_;
  asio::ip::address peer_;
  std::string name_;
  MbapReader reader_;
  std::vector<std::uint8_t> out_;
  std::array<std::uint16_t, kMaxReadRegisters> words_{};  ///< of the write under way
  ServerTimer waker_;
  Deadline timer_;
  bool timing_ = false;
  bool waiting_ = false;
  bool open_ = true;
  Clock::time_point last_request_ = Clock::now();
};

}  // namespace drivebench::modbus
