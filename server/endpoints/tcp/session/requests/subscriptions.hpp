#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "protocols/signals/catalogue.hpp"
#include "server/endpoints/tcp/sending/audience.hpp"
#include "server/endpoints/tcp/session/dialogue.hpp"

namespace drivebench {

/// The subscriptions of a session, one for each axis at most.
class Subscriptions final : public Audience::Viewer {
 public:
  explicit Subscriptions(Dialogue& dialogue) : dialogue_(dialogue) {}

  void subscribe(const v1::Subscribe& request);
  /// Sends the waiting samples; false if none wait, or the peer takes nothing now.
  bool send_samples() override;

 private:
  static constexpr std::size_t kSamplesPerMessage = 32;

  struct Subscription {
    std::uint32_t axis;
    SignalMask mask;
    std::shared_ptr<const SampleFeed> feed;
    SampleFeed::Reader reader;
  };

  Dialogue& dialogue_;
  std::vector<Subscription> subscriptions_;
};

}  // namespace drivebench
