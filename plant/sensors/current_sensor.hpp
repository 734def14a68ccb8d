#pragma once

#include "plant/sensors/analog_channel.hpp"

namespace drivebench {

/// Section [axis.current_sensor]: current measurement of the phases, always on. The field current goes
/// through a channel like theirs, of gain 1 and without offset.
struct CurrentSensorParameters {
  int bits = 0;                ///< resolution of the converter; 0: ideal, neither quantised nor limited
  double full_scale_a = 10.0;  ///< the converter spans -full_scale to +full_scale less one step
  double gain_a = 1.0;         ///< of phase a
  double gain_b = 1.0;
  double gain_c = 1.0;
  double offset_a_a = 0.0;  ///< of phase a
  double offset_b_a = 0.0;
  double offset_c_a = 0.0;
  double noise_rms_a = 0.0;  ///< Gaussian, white from tick to tick
  double delay_ticks = 0.0;  ///< 0, 0.5 or a whole number up to 8: how old the sample is
  double filter_hz = 0.0;    ///< first-order low-pass before the converter; 0: none
};

/// The channel of a phase with this gain and offset.
AnalogParameters current_channel(const CurrentSensorParameters& p, double gain, double offset_a) noexcept;

}  // namespace drivebench
