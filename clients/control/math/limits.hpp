#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace drivebench::control {

/// The demand of a move for one quantity at one instant, and its limit. Both texts must be literals.
struct Demand {
  std::string_view quantity;  ///< like "stator voltage"
  double value;               ///< its magnitude is judged
  double limit;
  std::string_view unit;  ///< like "V"
};

/// The first demand of a move beyond its limit.
struct Exceeded {
  Demand demand;
  double time_s;  ///< since the start of the move

  /// "stator voltage of 93.1 V at 0.312 s is above the limit of 80 V"
  std::string sentence() const;
};

/// The first demand above its limit of a move that lasts duration_s (finite), looked at every step_s (but at
/// most a million times) and at the end; of several at one instant the one named first. `demands_at(t_s)`
/// gives the demands as a range: the currents i_ref and voltages u_ref that the trajectory needs of this
/// machine. A demand that is not a number counts as exceeded. Made for the time before a move: a controller
/// that meets a limit amid one can only fail.
template <class DemandsAt>
std::optional<Exceeded> first_exceeded(double duration_s, double step_s, DemandsAt&& demands_at) {
  constexpr double kMostSteps = 1e6;
  step_s = std::max(step_s, duration_s / kMostSteps);
  const auto steps = static_cast<std::int64_t>(std::ceil(duration_s / step_s));
  for (std::int64_t k = 0; k <= steps; ++k) {
    const double t_s = k == steps ? duration_s : step_s * static_cast<double>(k);
    for (const Demand& demand : demands_at(t_s)) {
      if (!(std::abs(demand.value) <= demand.limit)) return Exceeded{demand, t_s};
    }
  }
  return std::nullopt;
}

/// Throws std::invalid_argument with the sentence when a limit is exceeded: the refusal of a move.
void refuse(const std::optional<Exceeded>& exceeded);

}  // namespace drivebench::control
