#pragma once

#include <cmath>
#include <complex>

#include "plant/math/phasor.hpp"

namespace drivebench::identification {

/// The direction of an angle, e^(j a), from which those of angles nearby follow by their series: a model that
/// turns its frame asks for several within each step, and cosine and sine of the library would take most of
/// its time. Beyond a quarter of a radian the library is asked; the series is right to 1e-14 up to there.
class Direction {
 public:
  Direction() = default;
  explicit Direction(double angle_rad) noexcept : angle_rad_(angle_rad), at_(phasor(angle_rad)) {}

  std::complex<double> of(double angle_rad) const noexcept {
    const double d = angle_rad - angle_rad_;
    constexpr double kNear_rad = 0.25;
    if (!(std::abs(d) < kNear_rad)) return phasor(angle_rad);
    const double d2 = d * d;
    const double sine =
        d *
        (1.0 - d2 * (1.0 / 6.0) * (1.0 - d2 * (1.0 / 20.0) * (1.0 - d2 * (1.0 / 42.0) * (1.0 - d2 / 72.0))));
    const double less =
        0.5 * d2 *
        (1.0 - d2 * (1.0 / 12.0) * (1.0 - d2 * (1.0 / 30.0) * (1.0 - d2 * (1.0 / 56.0) * (1.0 - d2 / 90.0))));
    return {at_.real() - (at_.real() * less + at_.imag() * sine),
            at_.imag() + (at_.real() * sine - at_.imag() * less)};
  }
  /// The same from another angle on.
  Direction moved(double angle_rad) const noexcept {
    Direction there;
    there.angle_rad_ = angle_rad;
    there.at_ = of(angle_rad);
    return there;
  }

 private:
  double angle_rad_ = 0.0;
  std::complex<double> at_ = 1.0;
};

}  // namespace drivebench::identification
