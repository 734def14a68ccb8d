#pragma once

#include "plant/sensors/current_sensor.hpp"

/// The reading of one channel of the sensor bank.
namespace drivebench {

/// gain x + offset + noise, then the converter.
constexpr AnalogReading read_analog(const AnalogParameters& p, double x, double unit_noise) noexcept {
  return converted(p.gain * x + p.offset + p.noise_rms * unit_noise, p.bits, p.full_scale);
}

/// The same of the channel of a phase current with this gain and offset.
inline AnalogReading read_current(const CurrentSensorParameters& p, double gain, double offset_a,
                                  double current_a, double unit_noise) noexcept {
  return read_analog(current_channel(p, gain, offset_a), current_a, unit_noise);
}

}  // namespace drivebench
