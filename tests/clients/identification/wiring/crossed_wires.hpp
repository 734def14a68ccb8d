#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <string_view>
#include <utility>

#include "clients/identification/data/measured_data.hpp"

namespace drivebench::identification {

/// What can be wired otherwise than the bench does.
struct CrossedWires {
  bool reversed = false;  ///< the encoder counts against the phases
  int zero_counts = 0;    ///< of the encoder where the magnet points to phase a
  int late_samples = 0;   ///< of the voltages' column
  bool crossed = false;   ///< phases b and c have changed places, of voltages and currents alike
};

/// A record as another wiring would have shown it.
inline void cross(MeasuredData& data, const CrossedWires& wires) {
  const auto column = [&](std::string_view name) -> Column* {
    for (Column& each : data.columns) {
      if (each.name == name) return &each;
    }
    return nullptr;
  };
  for (double& count : column("encoder_count")->values)
    count = (wires.reversed ? -1.0 - count : count) + wires.zero_counts;
  for (Column& each : data.columns) {
    if (!each.name.starts_with("u_")) continue;
    const Series before = each.values;
    for (std::size_t k = 0; k < before.size(); ++k)
      each.values[k] = before[k - std::min(k, static_cast<std::size_t>(wires.late_samples))];
  }
  if (!wires.crossed) return;
  std::swap(column("u_b_v")->values, column("u_c_v")->values);
  std::swap(column("i_b_a")->values, column("i_c_a")->values);
}

}  // namespace drivebench::identification
