#include "clients/reference/rest.hpp"

#include <cmath>
#include <numbers>
#include <utility>

#include "clients/reference/answers.hpp"

namespace drivebench::reference {
namespace {

constexpr double kRest_s = 0.050;
constexpr int kMostRests = 100;
constexpr double kStill_rad_s = 1.0;  // holding a position against the steps of the encoder leaves 0.2

}  // namespace

Rest::Rest(double period_s, double counts_per_revolution, SignalMask known) noexcept
    : period_s_(period_s),
      rad_per_count_(counts_per_revolution > 0.0 ? 2.0 * std::numbers::pi / counts_per_revolution : 0.0),
      known_(known) {}

Rest::State Rest::see(const Sample& sample, const Sample* second) noexcept {
  if (!std::exchange(has_start_, true)) start_ = half_way_ = sample;
  const double rest_ticks = kRest_s / period_s_;
  const auto rested_ticks = static_cast<double>(sample.tick - start_.tick);
  if (rested_ticks < rest_ticks || !is_armed(sample)) {
    if (rested_ticks < rest_ticks / 2) half_way_ = sample;
    return State::kGoesOn;
  }
  speed_rad_s_ = speed_at(sample);
  if (second != nullptr && std::abs(second->speed_rad_s) > std::abs(speed_rad_s_))
    speed_rad_s_ = second->speed_rad_s;
  if (std::abs(speed_rad_s_) <= kStill_rad_s) return State::kStill;
  start_ = half_way_ = sample;
  return ++rests_ < kMostRests ? State::kGoesOn : State::kTurns;
}

/// Whether the bench obeys the commands: an axis that is idle or ready has too few of them.
bool Rest::is_armed(const Sample& sample) const noexcept {
  constexpr std::uint64_t kIdle = 0;
  constexpr std::uint64_t kReady = 5;
  return !knows(bit_of("state")) || (sample.state != kIdle && sample.state != kReady);
}

double Rest::speed_at(const Sample& sample) const noexcept {
  if (knows(bit_of("speed_rad_s"))) return sample.speed_rad_s;
  if (rad_per_count_ == 0.0) return 0.0;
  // A count within the second half of 50 ms is 0.13 rad/s.
  const double turned_rad =
      static_cast<double>(sample.encoder_count - half_way_.encoder_count) * rad_per_count_;
  return turned_rad / (static_cast<double>(sample.tick - half_way_.tick) * period_s_);
}

}  // namespace drivebench::reference
