#pragma once

#include <string>

#include "clients/regression/checks/check.hpp"

namespace drivebench::command {

/// The frequency response of a check as a Bode plot, an SVG picture of 720 pixels width: gain in decibels
/// above phase in degrees, over the logarithm of the frequency. Lines with too much noise are hollow. Of a
/// loop it marks the crossover with its phase margin, and the frequency of -180 degrees with its gain margin.
std::string bode_plot(const regression::Finding& finding);

}  // namespace drivebench::command
