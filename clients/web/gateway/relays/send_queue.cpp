#include "clients/web/gateway/relays/send_queue.hpp"

#include <bench.pb.h>

#include "protocols/framing.hpp"

namespace drivebench::web {

bool SendQueue::add(std::span<const std::byte> payload) {
  // Only a browser that is or was too slow costs a look into the frame.
  return lost_.empty() && message_.size() < kSamplesLimit ? put(payload) : add_slowly(payload);
}

void SendQueue::take(std::vector<std::byte>& message) noexcept {
  message.clear();
  message.swap(message_);
}

bool SendQueue::put(std::span<const std::byte> payload) {
  if (message_.size() + payload.size() > kLimit) return false;
  const auto header = frame_header(static_cast<std::uint32_t>(payload.size()));
  message_.insert(message_.end(), header.begin(), header.end());
  message_.insert(message_.end(), payload.begin(), payload.end());
  return true;
}

bool SendQueue::add_slowly(std::span<const std::byte> payload) {
  v1::Envelope envelope;
  if (!envelope.ParseFromArray(payload.data(), static_cast<int>(payload.size())) || !envelope.has_samples()) {
    return put(payload);
  }
  v1::Samples& samples = *envelope.mutable_samples();
  if (message_.size() >= kSamplesLimit) {
    lost_[samples.axis()] += samples.dropped() + static_cast<std::uint64_t>(samples.samples_size());
    return true;
  }
  const auto lost = lost_.find(samples.axis());
  if (lost == lost_.end()) return put(payload);
  samples.set_dropped(samples.dropped() + lost->second);
  lost_.erase(lost);
  const std::string text = envelope.SerializeAsString();
  return put(std::as_bytes(std::span(text)));
}

}  // namespace drivebench::web
