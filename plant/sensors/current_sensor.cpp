#include "plant/sensors/current_sensor.hpp"

namespace drivebench {

AnalogParameters current_channel(const CurrentSensorParameters& p, double gain, double offset_a) noexcept {
  return {.enabled = true,
          .bits = p.bits,
          .full_scale = p.full_scale_a,
          .gain = gain,
          .offset = offset_a,
          .noise_rms = p.noise_rms_a,
          .delay_ticks = p.delay_ticks,
          .filter_hz = p.filter_hz};
}

}  // namespace drivebench
