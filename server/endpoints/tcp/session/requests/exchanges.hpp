#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "protocols/sample_codec.hpp"
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
  Exchanges(Dialogue& dialogue, const Leases& leases, Subscriptions& subscriptions);

  void exchange(const v1::Exchange& request);
  /// After a tick: answers the exchange that waits for it.
  void on_newest() override;
  /// Refuses an exchange that waits for a tick of this axis: the session no longer holds it, so the tick
  /// might never come.
  void abandon(std::uint32_t axis);

  ExcessLimit& excess() noexcept { return excess_; }

 private:
  struct Waiting {
    std::uint64_t id;
    std::vector<std::uint32_t> axes;
  };

  /// The axes of the commands; nothing after it has refused the request.
  std::optional<std::vector<std::uint32_t>> axes_of(const v1::Exchange& request);
  bool are_taken(const v1::Exchange& request);
  void add_shared(std::vector<std::uint32_t>& axes) const;
  void reply(std::uint64_t id, std::span<const std::uint32_t> axes);

  Dialogue& dialogue_;
  Engine& engine_;
  const Leases& leases_;
  Subscriptions& subscriptions_;
  ExcessLimit excess_;
  std::vector<AxisSampleView> views_;
  std::optional<Waiting> waiting_;
};

}  // namespace drivebench
