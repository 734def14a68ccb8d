#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "clients/models/induction_circuit.hpp"

namespace drivebench::command {

/// The steady state of an induction motor on a line, from its equivalent circuit.
struct SteadyStateOptions {
  std::string motor{};  ///< file, or name in configs/motors
  double voltage_v = 0.0;
  double frequency_hz = 0.0;
  double load_nm = 0.0;
  double line_resistance_ohm = 0.0;
  double line_inductance_h = 0.0;
  std::string plot_file{};    ///< SVG: torque, current and power over speed
  std::string circle_file{};  ///< SVG: the circle diagram
  bool json = false;
};
int run_steady_state(const SteadyStateOptions& options);

/// A point of the table.
struct NamedPoint {
  std::string_view name;
  InductionCircuit::Point point;
};

/// No load, the load, and the points of the book; without the load's if no slip carries it.
std::vector<NamedPoint> named_points(const InductionCircuit& circuit, double load_nm);

}  // namespace drivebench::command
