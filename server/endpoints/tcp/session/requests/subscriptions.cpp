#include "server/endpoints/tcp/session/requests/subscriptions.hpp"

#include <fmt/core.h>

#include <utility>

#include "protocols/nearest_name.hpp"
#include "protocols/sample_codec.hpp"
#include "protocols/text.hpp"

namespace drivebench {

void Subscriptions::subscribe(const v1::Subscribe& r) {
  if (!dialogue_.axis_exists(r.axis())) return;
  SignalMask mask = r.signals().empty() ? kAllSignals : 0;
  for (const std::string& name : r.signals()) {
    const Signal* signal = find_signal(name);
    if (signal == nullptr) {
      return dialogue_.refuse(
          dialogue_.id(), v1::REFUSAL_UNKNOWN_SIGNAL,
          "there is no signal '" + printable(name) + "'" + did_you_mean(name, kSignals, &Signal::name),
          "signals");
    }
    mask |= SignalMask{1} << (signal - kSignals.data());
  }
  Audience& audience = dialogue_.context().audience;
  std::shared_ptr<const SampleFeed> feed;
  if (r.decimation() > 0) {
    feed = audience.feed(r.axis(), r.decimation());
    if (feed == nullptr) {
      return dialogue_.refuse(
          dialogue_.id(), v1::REFUSAL_BUSY,
          fmt::format("the sessions subscribe to {} different decimations, the most that the server keeps "
                      "samples for; 1 is always possible",
                      Audience::kMostDecimatedFeeds),
          "decimation");
    }
  }
  std::erase_if(subscriptions_, [&](const Subscription& s) { return s.axis == r.axis(); });
  if (feed != nullptr) {
    const SampleFeed::Reader reader = feed->reader();
    subscriptions_.push_back({.axis = r.axis(), .mask = mask, .feed = std::move(feed), .reader = reader});
  }
  if (subscriptions_.empty()) {
    audience.remove_subscriber(*this);
  } else {
    audience.add_subscriber(*this);
  }
  dialogue_.done(dialogue_.id(), dialogue_.engine().tick());
}

bool Subscriptions::send_samples() {
  bool sent = false;
  for (Subscription& s : subscriptions_) {
    while (dialogue_.outbox().idle() && dialogue_.socket().is_open()) {
      const std::span<const Sample> samples = s.feed->read(s.reader, kSamplesPerMessage);
      if (samples.empty()) break;
      dialogue_.scratch().clear();
      append_samples(dialogue_.scratch(), s.axis, std::exchange(s.reader.dropped, 0), samples, s.mask);
      dialogue_.send_scratch();
      sent = true;
    }
  }
  return sent;
}

}  // namespace drivebench
