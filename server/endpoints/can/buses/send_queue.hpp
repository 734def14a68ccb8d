#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>

#include "protocols/can/frame.hpp"

namespace drivebench::can {

/// Frames that wait for room in the transport: at most one per identifier, the newest, in the order in which
/// the identifiers arrived.
class SendQueue {
 public:
  /// The number of standard identifiers.
  static constexpr std::size_t kMaxPending = 2048;

  /// Adds a frame, or replaces an older one with its identifier. Returns the number of lost frames: the older
  /// one, or this one if the queue is full.
  std::uint64_t push(const Frame& frame) {
    const auto same = [&](const Frame& other) {
      return other.id == frame.id && other.extended == frame.extended && other.remote == frame.remote;
    };
    const auto old = std::find_if(frames_.begin(), frames_.end(), same);
    if (old != frames_.end()) {
      *old = frame;
      return 1;
    }
    if (frames_.size() == kMaxPending) return 1;
    frames_.push_back(frame);
    return 0;
  }

  bool empty() const noexcept { return frames_.empty(); }
  const Frame& front() const noexcept { return frames_.front(); }
  void pop() noexcept { frames_.pop_front(); }

  /// Drops all frames and returns their number.
  std::uint64_t clear() noexcept {
    const std::uint64_t count = frames_.size();
    frames_.clear();
    return count;
  }

 private:
  std::deque<Frame> frames_;
};

}  // namespace drivebench::can
