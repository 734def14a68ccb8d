#pragma once

#include "plant/sensors/absolute_encoder.hpp"
#include "plant/sensors/analog_channel.hpp"
#include "plant/sensors/comparators.hpp"
#include "plant/sensors/current_sensor.hpp"
#include "plant/sensors/hall.hpp"
#include "plant/sensors/meter.hpp"
#include "plant/sensors/ntc.hpp"
#include "plant/sensors/resolver.hpp"
#include "plant/sensors/shunts.hpp"
#include "plant/sensors/tachometer.hpp"

namespace drivebench {

/// All sensors but the incremental encoder.
struct SensorParameters {
  CurrentSensorParameters current{};
  AnalogParameters voltage{};      ///< terminal voltages
  AnalogParameters neutral{};      ///< motor neutral against the middle of the DC link
  AnalogParameters bus{};          ///< DC link
  AnalogParameters temperature{};  ///< of the winding
  TachometerParameters tachometer{};
  ResolverParameters resolver{};
  HallParameters hall{};
  MeterParameters meter{};
  bool terminals = false;  ///< the terminals are shown against the negative rail
  bool counts = false;     ///< the numbers of the converters are shown
  ComparatorParameters comparator{};
  ShuntParameters shunts{};
  NtcParameters ntc{};
  AbsoluteEncoderParameters absolute{};

  /// Whether something follows the terminals against the negative rail.
  bool follow_terminals() const noexcept { return terminals || comparator.enabled; }
};

}  // namespace drivebench
