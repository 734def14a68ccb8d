#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "clients/control/estimators/observers.hpp"

namespace drivebench::control {

/// Angle and speed of a shaft from the counts of its encoder, speed by the observer with the torque that the
/// machine should be making (PMO-01, IMO-04).
///
/// The position counts from the first sample. The angle of the disc counts from count 0, as a commissioned
/// drive knows it: a synchronous machine must know where its magnet is after any earlier run.
class ShaftSensing {
 public:
  ShaftSensing(double counts_per_revolution, const SpeedObserverGains& gains, double friction_rate_per_s,
               double period_s, SpeedSource source = SpeedSource::kObserver) noexcept
      : counts_per_revolution_(counts_per_revolution),
        period_s_(period_s),
        source_(source),
        observer_(gains, friction_rate_per_s, period_s),
        difference_(counts_per_revolution, period_s) {}

  /// One sample, `periods` after the last one; `acceleration_rad_s2` is what the machine gave in between, as
  /// far as the last sample tells. Over a gap the observer follows its own angle.
  void measure(std::int64_t count, std::int64_t periods, double acceleration_rad_s2) noexcept {
    constexpr std::int64_t kLongestGap = 64;
    if (!started_) {
      started_ = true;
      start_count_ = count;
    } else {
      for (std::int64_t i = 0; i < std::min(periods, kLongestGap); ++i) {
        observer_.step(angle_rad_ + static_cast<double>(i) * period_s_ * observer_.speed_rad_s(),
                       acceleration_rad_s2);
      }
    }
    const double difference_rad_s = difference_.step(count, periods);
    speed_rad_s_ = source_ == SpeedSource::kObserver ? observer_.speed_rad_s() : difference_rad_s;
    const double rad_per_count = 2.0 * std::numbers::pi / counts_per_revolution_;
    angle_rad_ = rad_per_count * static_cast<double>(count - start_count_);
    disc_rad_ = rad_per_count * std::fmod(static_cast<double>(count), counts_per_revolution_);
  }

  double angle_rad() const noexcept { return angle_rad_; }  ///< since the first sample
  double disc_rad() const noexcept { return disc_rad_; }    ///< since count 0, without whole turns
  double speed_rad_s() const noexcept { return speed_rad_s_; }

 private:
  double counts_per_revolution_;
  double period_s_;
  SpeedSource source_;
  SpeedObserver observer_;
  BackwardDifference difference_;
  bool started_ = false;
  std::int64_t start_count_ = 0;
  double angle_rad_ = 0.0;
  double disc_rad_ = 0.0;
  double speed_rad_s_ = 0.0;
};

}  // namespace drivebench::control
