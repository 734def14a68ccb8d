#pragma once

#include <string>
#include <vector>

#include "clients/command/motor/steady_state.hpp"

namespace drivebench::command {

/// Torque, current, power split and power factor over the speed, from backward at half the synchronous speed
/// to the generator's largest power, as an SVG picture.
std::string steady_state_plot(const InductionCircuit& circuit, const std::string& title);

/// The circle of the stator current with the named points, to one scale on both axes, as an SVG picture.
std::string circle_diagram(const InductionCircuit& circuit, const std::vector<NamedPoint>& points,
                           const std::string& title);

}  // namespace drivebench::command
