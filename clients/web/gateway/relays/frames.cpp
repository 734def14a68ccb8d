#include "clients/web/gateway/relays/frames.hpp"

#include "protocols/framing.hpp"

namespace drivebench::web {

std::string_view problem_of_frames(std::span<const std::byte> message) noexcept {
  if (message.empty()) return "a message holds at least one frame";
  while (!message.empty()) {
    if (message.size() < kFrameHeaderSize) return "the message ends in the length of a frame";
    std::size_t size = 0;
    for (const std::byte each : message.first(kFrameHeaderSize))
      size = size << 8 | std::to_integer<std::size_t>(each);
    message = message.subspan(kFrameHeaderSize);
    if (size == 0) return "a frame is empty";
    if (size > kMaxRequestFrame) return "a frame is longer than a request may be";
    if (size > message.size()) return "the message ends in a frame";
    message = message.subspan(size);
  }
  return {};
}

}  // namespace drivebench::web
