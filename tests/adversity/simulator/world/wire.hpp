#pragma once

#include <cstddef>
#include <deque>
#include <memory>
#include <span>
#include <string>

#include "tests/adversity/simulator/world/random.hpp"
#include "tests/adversity/simulator/world/schedule.hpp"

namespace drivebench::simulator {

/// The faults of a network between client and server.
struct Quality {
  Time delay = 0;     ///< of every byte to the server
  Time jitter = 0;    ///< at most so much more
  double torn = 0.0;  ///< share of messages that are split at any byte, into pieces with delays of their own
};

/// The client's end of a stream socket behind a network: bytes arrive later and in pieces, the network may
/// stop for a while, and it may be cut.
class Wire : public std::enable_shared_from_this<Wire> {
 public:
  Wire(Schedule& schedule, Random random, const Quality& quality, int socket)
      : schedule_(schedule), random_(random), quality_(quality), socket_(socket) {}
  ~Wire() { cut(); }
  Wire(const Wire&) = delete;
  Wire& operator=(const Wire&) = delete;

  bool is_open() const noexcept { return socket_ >= 0; }
  /// Whether the server's end is open, even if some of its bytes have not arrived.
  bool is_connected() const;
  void send(std::string bytes);
  /// Whether sent bytes have not arrived yet.
  bool has_under_way() const noexcept { return !under_way_.empty(); }
  /// The arrived bytes, at most `most`; closes the wire when the server has.
  std::span<const std::byte> receive(std::size_t most);
  /// Nothing passes in either direction until then.
  void stop_until(Time time) { stopped_until_ = time; }
  /// From now on the network is good.
  void heal();
  /// Cuts the connection: bytes on their way are lost.
  void cut();
  /// Closes this end for sending.
  void shut();

 private:
  void deliver();

  Schedule& schedule_;
  Random random_;
  Quality quality_;
  int socket_;
  Time last_arrival_ = 0;  ///< of a piece on its way: none overtakes another
  Time stopped_until_ = 0;
  bool delivering_ = false;
  struct Piece {
    Time arrival;
    std::string bytes;
  };
  std::deque<Piece> under_way_;
};

/// A socket connected to this unix socket; -1 if there is no room.
int connect_to(const std::string& path);

}  // namespace drivebench::simulator
