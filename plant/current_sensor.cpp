#include "plant/current_sensor.hpp"

#include "plant/rounding.hpp"

namespace drivebench {

CurrentReading read_current(const CurrentSensorParameters& p, double gain, double offset_a, double current_a,
                            double unit_noise) noexcept {
  const double analog_a = gain * current_a + offset_a + p.noise_rms_a * unit_noise;
  if (p.bits == 0) return {.current_a = analog_a, .saturated = false};
  const double steps_per_side = static_cast<double>(std::int64_t{1} << (p.bits - 1));
  const double step_a = p.full_scale_a / steps_per_side;
  const double steps = analog_a / step_a + 0.5;
  if (steps >= steps_per_side) return {.current_a = (steps_per_side - 1.0) * step_a, .saturated = true};
  if (steps < -steps_per_side) return {.current_a = -p.full_scale_a, .saturated = true};
  return {.current_a = static_cast<double>(floor_to_integer(steps)) * step_a, .saturated = false};
}

}  // namespace drivebench
