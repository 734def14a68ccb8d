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

CurrentReading read_current(const CurrentSensorParameters& p, double gain, double offset_a, double current_a,
                            double unit_noise) noexcept {
  const AnalogReading r = read_analog(current_channel(p, gain, offset_a), current_a, unit_noise);
  return {.current_a = r.value, .saturated = r.saturated};
}

}  // namespace drivebench
