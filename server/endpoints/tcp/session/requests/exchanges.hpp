#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "protocols/sample_codec.hpp"
#include "protocols/shm/segment.hpp"
#include "server/endpoints/tcp/sending/audience.hpp"
#include "server/endpoints/tcp/session/dialogue.hpp"
#include "server/endpoints/tcp/session/requests/excess_limit.hpp"
#include "server/endpoints/tcp/session/requests/leases.hpp"
#include "server/endpoints/tcp/session/requests/subscriptions.hpp"

namespace drivebench {

/// The exchanges of a session: commands in, the samples of their tick out. One exchange may wait for its
/// tick.
class Exchanges final : public Audience::Waiter {
 public:
  /// The way by which an exchange came and by which its answer goes back.
  class Way {
   public:
    virtual void answer(std::uint64_t id, std::span<const AxisSampleView> samples) = 0;
    virtual void refuse(std::uint64_t id, v1::RefusalCode code, const std::string& sentence,
                        const char* field) = 0;

   protected:
    ~Way() = default;
  };

  Exchanges(Dialogue& dialogue, const Leases& leases, Subscriptions& subscriptions);

  /// Over the socket of the session.
  void exchange(const v1::Exchange& request);
  /// No commands: the newest sample of every axis.
  void exchange(std::span<const shm::CommandRecord> commands, Way& way, std::uint64_t id);
  /// After a tick: answers the exchange that waits for it.
  void on_newest() override;
  /// Refuses an exchange that waits for a tick of this axis: the session no longer holds it, so the tick
  /// might never come.
  void abandon(std::uint32_t axis);

  ExcessLimit& excess() noexcept { return excess_; }

 private:
  /// Frames on the socket.
  class Frames final : public Way {
   public:
    explicit Frames(Dialogue& dialogue) : dialogue_(dialogue) {}
    void answer(std::uint64_t id, std::span<const AxisSampleView> samples) override;
    void refuse(std::uint64_t id, v1::RefusalCode code, const std::string& sentence,
                const char* field) override;

   private:
    Dialogue& dialogue_;
  };
  struct Waiting {
    Way* way;
    std::uint64_t id;
    ServerClock::time_point since;
  };

  struct AxisCommand {
    std::uint32_t axis;
    Command command;
  };

  /// Puts the commands into commands_ and their axes into axes_; false after it has refused the request.
  bool read(std::span<const shm::CommandRecord> sent, Way& way, std::uint64_t id);
  bool are_taken(Way& way, std::uint64_t id);
  void add_shared();
  void answer(Way& way, std::uint64_t id);

  Dialogue& dialogue_;
  Engine& engine_;
  const Leases& leases_;
  Subscriptions& subscriptions_;
  Frames frames_;
  ExcessLimit excess_;
  std::vector<shm::CommandRecord> frame_;  // the commands of the present frame
  std::vector<AxisCommand> commands_;      // of the present exchange
  std::vector<std::uint32_t> axes_;        // of the present exchange, or of the one that waits
  std::vector<AxisSampleView> views_;
  std::optional<Waiting> waiting_;
};

}  // namespace drivebench
