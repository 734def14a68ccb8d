#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "server/endpoints/tcp/sample_feed.hpp"
#include "server/engine/engine.hpp"
#include "server/host/asio.hpp"

namespace drivebench {

class Session;

/// The sessions that a tick concerns, so that all others cost it nothing: those whose exchange waits for it,
/// which are answered first, and those with subscriptions. Of these a few are served in a turn, and there is
/// a pause between turns: many viewers get more samples in a message, instead of making a controller wait.
class Audience {
 public:
  Audience(asio::io_context& io, Engine& engine) : engine_(engine), next_turn_(io) {}

  /// Until remove_subscriber().
  void add_subscriber(Session& session);
  void remove_subscriber(const Session& session);
  /// Until the next on_newest().
  void add_waiting(Session& session);
  /// Whatever it was.
  void remove(const Session& session);
  /// Samples from now on, kept as long as somebody holds them.
  std::shared_ptr<const SampleFeed> feed(std::uint32_t axis, std::uint32_t decimation);

  /// As Engine calls its listeners.
  void on_tick();
  void on_newest();

  /// Sends what waits to all who take it.
  void send_all();

 private:
  static constexpr int kSessionsPerTurn = 4;
  static constexpr auto kPause = std::chrono::microseconds(500);
  static constexpr std::size_t kTicksBehind = 32;  ///< with no time for turns: then all are served

  void drop_unread_feeds();
  void take_turn();

  Engine& engine_;
  std::vector<std::shared_ptr<SampleFeed>> feeds_;
  std::vector<Session*> subscribers_;
  std::vector<Session*> waiting_;
  std::vector<Session*> answered_;  // of which on_newest() takes care just now
  std::size_t ticks_behind_ = 0;    // since on_newest()
  std::size_t next_ = 0;            // of subscribers_, in the next turn
  ServerTimer next_turn_;
  bool turn_to_come_ = false;
};

}  // namespace drivebench
