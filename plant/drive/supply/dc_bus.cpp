#include "plant/drive/supply/dc_bus.hpp"

#include <algorithm>
#include <cmath>

#include "plant/math/exponential.hpp"

namespace drivebench {
namespace {

/// The larger root v of (storage + leak) v^2 - (storage before + feed) v + power = 0, the voltage in the
/// middle of the interval; at least half of the voltage before, where the link ends empty.
double middle_voltage_v(double storage_s, double before_v, double leak_s, double feed_a,
                        double power_w) noexcept {
  const double a = storage_s + leak_s;
  const double b = storage_s * before_v + feed_a;
  const double root = std::sqrt(std::max(b * b - 4.0 * a * power_w, 0.0));
  return std::max((b + root) / (2.0 * a), 0.5 * before_v);
}

}  // namespace

double supply_voltage_v(const BusParameters& p, double amplifier_limit_v, Connection connection) noexcept {
  if (p.voltage_v > 0.0) return p.voltage_v;
  return connection == Connection::kStar ? 2.0 * amplifier_limit_v : amplifier_limit_v;
}

BusInterval bus_after(const BusParameters& p, double supply_v, double bus_v, bool chopper, double taken_j,
                      double duration_s) noexcept {
  const double per_s = 1.0 / duration_s;
  const double storage_s = 2.0 * p.capacitance_f * per_s;
  const double brake_s = chopper ? 1.0 / p.chopper_ohm : 0.0;
  const double power_w = taken_j * per_s;
  // A rectifier conducts if its voltage is above the larger root of the balance without it.
  const double leak_s = storage_s + brake_s;
  const bool fed = p.battery || (supply_v * (leak_s * supply_v - storage_s * bus_v) + power_w > 0.0 &&
                                 2.0 * leak_s * supply_v > storage_s * bus_v);
  double middle_v;
  double supplied_j = 0.0;
  if (fed && p.resistance_ohm > 0.0) {
    const double supply_s = 1.0 / p.resistance_ohm;
    middle_v = middle_voltage_v(storage_s, bus_v, brake_s + supply_s, supply_s * supply_v, power_w);
    supplied_j = duration_s * middle_v * (supply_v - middle_v) * supply_s;
  } else {
    middle_v = p.battery ? 0.5 * (bus_v + supply_v)  // whatever it takes
                         : middle_voltage_v(storage_s, bus_v, brake_s, 0.0, power_w);
  }
  const double braked_j = duration_s * middle_v * middle_v * brake_s;
  double after_v = 2.0 * middle_v - bus_v;
  if (p.resistance_ohm == 0.0 && (p.battery || after_v < supply_v)) {
    after_v = supply_v;
    supplied_j = 0.5 * p.capacitance_f * (after_v - bus_v) * (after_v + bus_v) + braked_j + taken_j;
  }
  return {.voltage_v = after_v, .supplied_j = supplied_j, .braked_j = braked_j};
}

ForeseenLink foreseen_link(const BusParameters& p, double supply_v, double bus_v, bool chopper,
                           double taken_a, double duration_s) noexcept {
  const double supply_s = 1.0 / p.resistance_ohm;
  const double leak_s = supply_s + (chopper ? 1.0 / p.chopper_ohm : 0.0);
  const double rest_v = (supply_s * supply_v - taken_a) / leak_s;
  const double x = leak_s * duration_s / p.capacitance_f;
  // x/(1 - e^-x) = 1 + x/2 + x^2/12 - ...
  const double mean_v = rest_v + (bus_v - rest_v) / (1.0 + x * (0.5 + x / 12.0));
  const double end_v = rest_v + (bus_v - rest_v) * exponential(-x);
  return {.mean_v = std::max(mean_v, 0.5 * bus_v), .end_v = std::max(end_v, 0.0)};
}

bool chopper_after(const BusParameters& p, double bus_v, bool on) noexcept {
  if (p.chopper_on_v == 0.0) return false;
  return bus_v > p.chopper_on_v || (on && bus_v >= p.chopper_off_v);
}

}  // namespace drivebench
