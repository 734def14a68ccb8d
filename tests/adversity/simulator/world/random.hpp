#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace drivebench::simulator {

/// Numbers that follow from a seed, the same on every machine (splitmix64).
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}

  std::uint64_t next() noexcept {
    std::uint64_t z = state_ += 0x9E3779B97F4A7C15u;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
  }
  /// 0 to limit - 1.
  std::uint64_t below(std::uint64_t limit) noexcept { return next() % limit; }
  /// Both ends included.
  std::int64_t between(std::int64_t low, std::int64_t high) noexcept {
    return low + static_cast<std::int64_t>(below(static_cast<std::uint64_t>(high - low) + 1));
  }
  double real(double low, double high) noexcept {
    return low + (high - low) * static_cast<double>(next() >> 11) * 0x1p-53;
  }
  bool chance(double probability) noexcept { return real(0.0, 1.0) < probability; }
  template <class T, std::size_t N>
  const T& pick(std::span<const T, N> of) noexcept {
    return of[below(of.size())];
  }
  /// Another sequence; a draw from one does not change the other.
  Random fork() noexcept { return Random(next()); }

 private:
  std::uint64_t state_;
};

}  // namespace drivebench::simulator
