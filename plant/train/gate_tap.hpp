#pragma once

#include <algorithm>

#include "plant/drive/phases.hpp"
#include "plant/math/frames.hpp"
#include "plant/sensors/event_log.hpp"

namespace drivebench {

/// Integrals over time since tick 0, by Simpson's rule on each piece: the state in the middle is that of the
/// cubic with the values and slopes of both ends, which errs by (h/tau)^4/2880 for a piece of length h. They
/// start at 0.
struct GateSums {
  ThreePhase current_as{};   ///< [A s] of the terminals, into the machine
  ThreePhase terminal_vs{};  ///< [V s] of the terminals, against the negative rail
  double link_as = 0.0;      ///< [A s] out of the link into the legs
  double link_vs = 0.0;      ///< [V s] of the link, constant in a piece
  double torque_nms = 0.0;   ///< [N m s]
  double link_j = 0.0;       ///< out of the link into the legs
  double electrical_j =
      0.0;                ///< into the terminals; what is missing to link_j is heat of switches and diodes
  double copper_j = 0.0;  ///< losses of the machine
  double shaft_j = 0.0;   ///< onto the shaft
};

/// What the pieces of a part of a tick report at gate level: see AxisCore::tap.
struct GateTap {
  EventLog events;
  GateSums sums;        ///< of all parts
  ThreePhase lowest_a;  ///< currents of the terminals where pieces of the part end
  ThreePhase highest_a;

  void begin_part() noexcept {
    events.clear();
    constexpr double kBeyondAll = 1e300;
    lowest_a = {.a = kBeyondAll, .b = kBeyondAll, .c = kBeyondAll};
    highest_a = {.a = -kBeyondAll, .b = -kBeyondAll, .c = -kBeyondAll};
  }
  void add_currents(const ThreePhase& current_a) noexcept {
    lowest_a = by_phase([](double x, double y) { return std::min(x, y); }, lowest_a, current_a);
    highest_a = by_phase([](double x, double y) { return std::max(x, y); }, highest_a, current_a);
  }
};

}  // namespace drivebench
