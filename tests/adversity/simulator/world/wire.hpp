#pragma once

#include <cstddef>
#include <deque>
#include <memory>
#include <span>
#include <string>

#include "tests/adversity/simulator/world/random.hpp"
#include "tests/adversity/simulator/world/schedule.hpp"

namespace drivebench::simulator {

/// What a network does to a stream.
struct Quality {
  Time delay = 0;   ///< of every byte to the server
  Time jitter = 0;  ///< at most so much more
  double torn =
      0.0;  ///< share of what is sent that is torn at any byte, into pieces with delays of their own
};

/// The client's end of a stream socket behind a network: what is sent arrives later and in pieces, it may
/// stop for a while, and it may be cut.
class Wire : public std::enable_shared_from_this<Wire> {
 public:
  Wire(Schedule& schedule, Random random, const Quality& quality, int socket)
      : schedule_(schedule), random_(random), quality_(quality), socket_(socket) {}
  ~Wire() { cut(); }
  Wire(const Wire&) = delete;
  Wire& operator=(const Wire&) = delete;

  bool is_open() const noexcept { return socket_ >= 0; }
  /// Whether the server's end is still there, whatever of its words has not arrived.
  bool is_connected() const;
  void send(std::string bytes);
  /// Whether something sent has not arrived yet.
  bool has_under_way() const noexcept { return !under_way_.empty(); }
  /// What has arrived, at most `most` bytes; closes the wire when the server has.
  std::span<const std::byte> receive(std::size_t most);
  /// Nothing passes in either direction until then.
  void stop_until(Time time) { stopped_until_ = time; }
  /// From now on the network is a good one.
  void heal();
  /// The end without a word: what is under way is lost.
  void cut();
  /// Nothing more comes from this end.
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
