#pragma once

#include <span>

#include "plant/parameters/parameters.hpp"

namespace drivebench {

/// The parameters of encoder, current sensors, the other sensors and the temperature of the winding.
std::span<const Parameter> sensor_rows() noexcept;

/// Appends what is wrong between the values, each of which lies within the limits of its row.
void add_problems(const EncoderParameters& p, Problems& found);
void add_problems(const SensorParameters& p, Problems& found);
void add_problems(const ThermalParameters& p, Problems& found);

}  // namespace drivebench
