#include "server/endpoints/tcp/sending/sample_feed.hpp"

#include <algorithm>
#include <utility>

namespace drivebench {

void SampleFeed::take(const Sample& newest) {
  if (newest.tick == last_tick_) return;
  const bool is_due = newest.tick % decimation_ == 0;
  skipped_ += newest.tick / decimation_ - last_tick_ / decimation_ - (is_due ? 1 : 0);
  last_tick_ = newest.tick;
  if (is_due) ring_[taken_++ % kDepth] = newest;
}

void SampleFeed::begin_anew(const Sample& first) {
  last_tick_ = first.tick;
  if (first.tick % decimation_ == 0) ring_[taken_++ % kDepth] = first;
}

std::span<const Sample> SampleFeed::read(Reader& reader, std::size_t at_most) const {
  reader.dropped += skipped_ - std::exchange(reader.skipped, skipped_);
  if (taken_ - reader.next > kDepth) {
    reader.dropped += taken_ - kDepth - reader.next;
    reader.next = taken_ - kDepth;
  }
  const std::size_t begin = reader.next % kDepth;
  const std::size_t count =
      std::min({static_cast<std::size_t>(taken_ - reader.next), at_most, kDepth - begin});
  reader.next += count;
  return std::span(ring_).subspan(begin, count);
}

}  // namespace drivebench
