#pragma once

#include "plant/math/trig.hpp"
#include "plant/sensors/analog_channel.hpp"

namespace drivebench {

/// Section [axis.tachometer]: a DC tachometer on the rotor.
struct TachometerParameters {
  AnalogParameters analog{};
  double gain_vs_per_rad = 0.0;
  double ripple = 0.0;      ///< of the voltage, peak over mean
  int ripple_per_turn = 0;  ///< commutator segments: periods of the ripple in a turn
};

/// K w (1 + ripple cos(n theta)): its sign is that of the speed. Source: the book, section 1.5.3.
inline double tachometer_v(const TachometerParameters& p, double angle_rad, double speed_rad_s) noexcept {
  const double mean_v = p.gain_vs_per_rad * speed_rad_s;
  if (p.ripple == 0.0) return mean_v;
  return mean_v * (1.0 + p.ripple * cosine(p.ripple_per_turn * angle_rad));
}

}  // namespace drivebench
