#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <map>

#include "server/host/asio.hpp"

namespace drivebench::modbus {

/// A bucket of tokens for each peer address, refilled at a steady rate up to one second's worth.
class RateLimit {
 public:
  using Clock = ServerClock;
  enum class Answer : std::uint8_t { kServe, kRefuse, kCut };

  /// 0: no limit.
  explicit RateLimit(std::uint32_t requests_per_s) : rate_(requests_per_s) {}

  /// Counts a request. Beyond the rate the answer is kRefuse, and after another second's worth of requests
  /// kCut.
  Answer charge(const asio::ip::address& peer, Clock::time_point now) {
    if (rate_ == 0.0) return Answer::kServe;
    forget_full_buckets(now);
    const auto [place, is_new] = buckets_.try_emplace(peer, Bucket{rate_, now});
    Bucket& bucket = place->second;
    refill(bucket, now);
    if (bucket.tokens < 1.0 - rate_) return Answer::kCut;
    bucket.tokens -= 1.0;
    return bucket.tokens >= 0.0 ? Answer::kServe : Answer::kRefuse;
  }

  /// Gives tokens back.
  void refund(const asio::ip::address& peer, double tokens) {
    const auto place = buckets_.find(peer);
    if (place != buckets_.end()) place->second.tokens = std::min(place->second.tokens + tokens, rate_);
  }

 private:
  static constexpr std::size_t kManyPeers = 1024;

  struct Bucket {
    double tokens;
    Clock::time_point filled;
  };

  void refill(Bucket& bucket, Clock::time_point now) const {
    const double elapsed_s = std::chrono::duration<double>(now - bucket.filled).count();
    bucket.tokens = std::min(bucket.tokens + elapsed_s * rate_, rate_);
    bucket.filled = now;
  }
  /// A full bucket need not be stored, and every bucket is full after two seconds.
  void forget_full_buckets(Clock::time_point now) {
    if (buckets_.size() < kManyPeers) return;
    std::erase_if(buckets_,
                  [now](const auto& entry) { return now - entry.second.filled > std::chrono::seconds(2); });
    if (buckets_.size() >= kManyPeers) buckets_.erase(buckets_.begin());
  }

  double rate_;
  std::map<asio::ip::address, Bucket> buckets_;
};

}  // namespace drivebench::modbus
