#pragma once

#include <cstdint>
#include <variant>

#include "plant/axis_parameters.hpp"
#include "plant/parameters/machine_kind.hpp"

namespace drivebench {

/// What an axis has to be commanded and measured at, as the field buses want to know it.
struct Terminals {
  Connection connection = Connection::kTwoPhase;
  bool field = false;          ///< a field winding with terminals of its own
  bool field_current = false;  ///< a field winding, whose current is measured
  bool speed_sensors = false;  ///< a tachometer or a resolver
  bool hall = false;

  bool has_b() const noexcept { return terminal_count(connection) >= 2; }
  bool has_c() const noexcept { return terminal_count(connection) >= 3; }
  /// Whether there is more to command than phases a and b.
  bool has_more() const noexcept { return has_c() || field; }
  /// Whether there is more to command or to measure than phases a and b, and an encoder.
  bool is_wide() const noexcept { return has_more() || field_current || speed_sensors || hall; }
  /// 1 a, 2 b, 4 c, 8 field.
  std::uint64_t bits() const noexcept {
    return 1u | (has_b() ? 2u : 0u) | (has_c() ? 4u : 0u) | (field ? 8u : 0u);
  }

  /// What a duty of 1 stands for: the whole DC link across a winding with a bridge of its own, half of it for
  /// a leg of a star, whose voltages are against the middle of the link.
  double volts_per_duty(double bus_voltage_v) const noexcept {
    return connection == Connection::kStar ? 0.5 * bus_voltage_v : bus_voltage_v;
  }
};

inline Terminals terminals_of(const AxisParameters& p) {
  const SensorParameters& sensors = p.sensors;
  const Field field = kind_of(p.machine).field;
  return {.connection = std::visit([](const auto& machine) { return connection_of(machine); }, p.machine),
          .field = field == Field::kOwnTerminals,
          .field_current = field != Field::kNone,
          .speed_sensors = sensors.tachometer.analog.enabled || sensors.resolver.analog.enabled,
          .hall = sensors.hall.enabled};
}

}  // namespace drivebench
