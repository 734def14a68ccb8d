#pragma once

#include "plant/drive/drive.hpp"
#include "plant/machines/machines.hpp"
#include "plant/mechanics/shaft.hpp"
#include "plant/sensors/encoder.hpp"
#include "plant/sensors/sensors.hpp"
#include "plant/thermal.hpp"

namespace drivebench {

/// Everything that describes one emulated drive train.
struct AxisParameters {
  MachineParameters machine;
  MechanicsParameters mechanics;
  DriveParameters drive;
  EncoderParameters encoder;
  SensorParameters sensors;
  ThermalParameters thermal;
};

}  // namespace drivebench
