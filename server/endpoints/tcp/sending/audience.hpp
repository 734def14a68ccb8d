#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "server/endpoints/tcp/sending/sample_feed.hpp"
#include "server/engine/engine.hpp"
#include "server/host/asio.hpp"

namespace drivebench {

/// The sessions that a tick concerns; the others cost no time in a tick. Sessions whose exchange waits for
/// the tick are answered first. Of the sessions with subscriptions a few are served in a turn, with a pause
/// between turns, so that many viewers get more samples in a message instead of making a controller wait.
class Audience {
 public:
  /// The part of a session that sends samples.
  class Viewer {
   public:
    /// Sends the waiting samples; false if none wait, or the peer takes nothing now.
    virtual bool send_samples() = 0;

   protected:
    ~Viewer() = default;
  };
  /// The part of a session that answers exchanges.
  class Waiter {
   public:
    /// Called when the newest sample is that of the tick for which this session waits.
    virtual void on_newest() = 0;

   protected:
    ~Waiter() = default;
  };

  /// The part of a session that looks at every sample.
  class Watcher {
   public:
    /// Called after each tick whose samples have reached the I/O thread.
    virtual void on_tick() = 0;
    /// Called when the bench has gone to another state.
    virtual void on_set_back() = 0;

   protected:
    ~Watcher() = default;
  };

  Audience(asio::io_context& io, Engine& engine) : engine_(engine), next_turn_(io) {}

  /// Serves the viewer until remove_subscriber().
  void add_subscriber(Viewer& viewer);
  void remove_subscriber(const Viewer& viewer);
  /// Keeps the session until the next on_newest() or remove_waiting().
  void add_waiting(Waiter& waiter);
  void remove_waiting(const Waiter& waiter);
  /// Calls the watcher until remove_watcher(), which it must not call from there.
  void add_watcher(Watcher& watcher);
  void remove_watcher(const Watcher& watcher);
  /// The most feeds of every n-th sample, n above 1, that all subscriptions together have: a feed takes 0.1
  /// MB.
  static constexpr std::size_t kMostDecimatedFeeds = 128;
  /// The samples from now on; the feed lives as long as a subscription holds it. Null: kMostDecimatedFeeds
  /// are read, and this would be one more.
  std::shared_ptr<const SampleFeed> feed(std::uint32_t axis, std::uint32_t decimation);

  /// The engine calls these like its listeners.
  void on_set_back();
  void on_tick();
  void on_newest();

  /// Sends the waiting samples to all subscribers that take them.
  void send_all();

 private:
  static constexpr int kSessionsPerTurn = 4;
  static constexpr auto kPause = std::chrono::microseconds(500);
  static constexpr std::size_t kTicksBehind =
      32;  ///< after so many ticks without time for a turn, serves all subscribers

  void drop_unread_feeds();
  void take_turn();

  Engine& engine_;
  std::vector<std::shared_ptr<SampleFeed>> feeds_;
  std::vector<Viewer*> subscribers_;
  std::vector<Watcher*> watchers_;
  std::vector<Waiter*> waiting_;
  std::vector<Waiter*> answered_;  // the sessions that on_newest() is answering
  std::size_t ticks_behind_ = 0;   // since on_newest()
  std::size_t next_ = 0;           // of subscribers_, in the next turn
  ServerTimer next_turn_;
  bool turn_to_come_ = false;
};

}  // namespace drivebench
