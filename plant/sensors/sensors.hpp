#pragma once

#include "plant/sensors/analog_channel.hpp"
#include "plant/sensors/current_sensor.hpp"
#include "plant/sensors/hall.hpp"
#include "plant/sensors/meter.hpp"
#include "plant/sensors/resolver.hpp"
#include "plant/sensors/tachometer.hpp"

namespace drivebench {

/// All sensors but the encoder.
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
};

}  // namespace drivebench
