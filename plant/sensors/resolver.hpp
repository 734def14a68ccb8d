#pragma once

#include "plant/math/trig.hpp"
#include "plant/sensors/analog_channel.hpp"

namespace drivebench {

/// Section [axis.resolver]: the demodulated windings, amplitude x sine and cosine of the angle.
struct ResolverParameters {
  AnalogParameters analog{};  ///< of both windings
  int pole_pairs = 1;
  double amplitude_v = 1.0;
  double sine_gain = 1.0;  ///< amplitude errors
  double cosine_gain = 1.0;
  double sine_offset_v = 0.0;
  double cosine_offset_v = 0.0;
};

struct ResolverVoltages {
  double sine_v;
  double cosine_v;
};

/// The voltages induced in the windings, without the offsets, which are those of the demodulators behind
/// them.
inline ResolverVoltages resolver_voltages(const ResolverParameters& p, double angle_rad) noexcept {
  const CosSin turned = cos_sin(p.pole_pairs * angle_rad);
  return {.sine_v = p.amplitude_v * p.sine_gain * turned.sin,
          .cosine_v = p.amplitude_v * p.cosine_gain * turned.cos};
}

}  // namespace drivebench
