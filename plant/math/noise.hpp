#pragma once

#include <cmath>
#include <cstdint>

#include "plant/math/trig.hpp"

/// Noise as a pure function of (seed, channel, tick): no generator state, so that a value depends neither on
/// the order of the calls nor on which other channels exist, and a replay or a branch from a saved state sees
/// the same noise.
///
/// The bits are those of a three-round keyed hash with the murmur-style finaliser below. It is not
/// cryptographic.
namespace drivebench {

namespace noise_detail {

/// A bijection of 64-bit words in which every input bit flips every output bit about half the time.
constexpr std::uint64_t mixed(std::uint64_t word) noexcept {
  word = (word ^ (word >> 30U)) * 0xbf58476d1ce4e5b9U;
  word = (word ^ (word >> 27U)) * 0x94d049bb133111ebU;
  return word ^ (word >> 31U);
}

/// The first two of three rounds. Each round adds an odd multiple of one argument to the mixed earlier ones,
/// so that equal sums of arguments, (seed + 1, channel) and (seed, channel + 1) for example, do not collide.
/// A zero key is as good as any.
constexpr std::uint64_t hashed(std::uint64_t seed, std::uint64_t channel) noexcept {
  const std::uint64_t word = mixed(seed + 0x9e3779b97f4a7c15U);
  return mixed(word + channel * 0xd1342543de82ef95U + 0x632be59bd9b4e019U);
}

/// The upper 53 bits as a number in [0, 1).
constexpr double unit_interval(std::uint64_t word) noexcept {
  return static_cast<double>(word >> 11U) * 0x1p-53;
}

}  // namespace noise_detail

/// The noise of one channel: what does not depend on the tick is worked out once.
class NoiseChannel {
 public:
  constexpr NoiseChannel(std::uint64_t seed, std::uint64_t channel) noexcept
      : hashed_(noise_detail::hashed(seed, channel)) {}

  /// The bits behind all that follows.
  constexpr std::uint64_t word(std::uint64_t tick) const noexcept {
    return noise_detail::mixed(hashed_ + tick * 0x9e3779b97f4a7c15U + 0x2545f4914f6cdd1dU);
  }

  /// Uniform in [0, 1). Not independent of gaussian() of the same tick: give each use its own channel.
  constexpr double uniform(std::uint64_t tick) const noexcept {
    return noise_detail::unit_interval(word(tick));
  }

  /// The draw in (0, 1] behind gaussian() of the same tick, which is at most sqrt(-2 log draw) in magnitude:
  /// cheaper to ask where only large noise matters.
  constexpr double draw(std::uint64_t tick) const noexcept {
    return uniform(tick) + 0x1p-53;  // its logarithm is finite
  }

  /// Normal with mean 0 and variance 1 (Box-Muller). Always finite: the magnitude is at most
  /// sqrt(106·log 2) = 8.57.
  double gaussian(std::uint64_t tick) const noexcept {
    constexpr double kTwoPi = 0x1.921fb54442d18p+2;
    const std::uint64_t second = noise_detail::mixed(word(tick) + 0xa0761d6478bd642fU);
    const double angle_rad = kTwoPi * noise_detail::unit_interval(second);
    return std::sqrt(-2.0 * logarithm(draw(tick))) * cosine(angle_rad);
  }

 private:
  std::uint64_t hashed_;
};

/// NoiseChannel::uniform() of a channel that is asked once.
constexpr double uniform_noise(std::uint64_t seed, std::uint64_t channel, std::uint64_t tick) noexcept {
  return NoiseChannel(seed, channel).uniform(tick);
}

/// NoiseChannel::gaussian() of a channel that is asked once.
inline double gaussian_noise(std::uint64_t seed, std::uint64_t channel, std::uint64_t tick) noexcept {
  return NoiseChannel(seed, channel).gaussian(tick);
}

}  // namespace drivebench
