#pragma once

#include "plant/windings.hpp"

namespace drivebench {

/// Section [axis.bus]: the DC link.
struct BusParameters {
  double voltage_v = 0.0;       ///< of its supply; 0: amplifier.voltage_limit_v (twice that in a star)
  double resistance_ohm = 0.0;  ///< of the supply
  double capacitance_f = 0.0;   ///< 0: a stiff link
  double chopper_on_v = 0.0;    ///< the brake resistor is switched on above this; 0: no chopper
  double chopper_off_v = 0.0;   ///< and off below this
  double chopper_ohm = 1.0;
  bool battery = false;  ///< the supply takes current back; a rectifier does not
};

/// Voltage of the supply of the link.
double supply_voltage_v(const BusParameters& p, double amplifier_limit_v, Connection connection) noexcept;

/// The voltage of the rails: against the middle of the link in a star, across a winding between two legs
/// else.
constexpr double rail_voltage_v(double bus_v, Connection connection) noexcept {
  return connection == Connection::kStar ? 0.5 * bus_v : bus_v;
}

/// A link with a capacitor after an interval, and where the energy went:
/// C (voltage_v^2 - before^2)/2 = supplied_j - braked_j - taken.
struct BusInterval {
  double voltage_v;
  double supplied_j;  ///< into the link; negative: into a battery
  double braked_j;    ///< into the brake resistor
};

/// The interval of a link whose terminals take `taken_j` (negative: give back):
///   C v' = i_S - [chopper] v/R_B - p/v     with i_S = max(U - v, 0)/R of a rectifier, (U - v)/R of a battery
/// by the implicit midpoint rule, which keeps the energy exactly and is stable for every interval. With R = 0
/// a rectifier holds the link at U or above, a battery at U. An interval that takes more than the link holds
/// empties it.
BusInterval bus_after(const BusParameters& p, double supply_v, double bus_v, bool chopper, double taken_j,
                      double duration_s) noexcept;

/// What a battery's link does in an interval in which its terminals take a constant current.
struct ForeseenLink {
  double mean_v;
  double end_v;
};

/// `taken_a` from the positive rail, of a battery with R > 0. The mean errs by x^4/720 of the way that the
/// link has to go, x the duration over its time constant, and is at least half of the voltage before, as in
/// bus_after().
ForeseenLink foreseen_link(const BusParameters& p, double supply_v, double bus_v, bool chopper,
                           double taken_a, double duration_s) noexcept;

/// Whether the brake resistor is on at this voltage, if it was on before.
bool chopper_after(const BusParameters& p, double bus_v, bool on) noexcept;

}  // namespace drivebench
