#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "plant/axis_parameters.hpp"
#include "plant/parameters/machine_kind.hpp"
#include "plant/parameters/parameters.hpp"

namespace drivebench {

/// The terminals and sensors of an axis, for the field buses.
struct Terminals {
  Connection connection = Connection::kTwoPhase;
  bool field = false;          ///< a field winding with its own terminals
  bool field_current = false;  ///< a field winding with a measured current
  bool speed_sensors = false;  ///< a tachometer or a resolver
  bool hall = false;

  bool has_b() const noexcept { return terminal_count(connection) >= 2; }
  bool has_c() const noexcept { return terminal_count(connection) >= 3; }
  /// Whether the axis has more set-points than phases a and b.
  bool has_more() const noexcept { return has_c() || field; }
  /// Whether the axis has more than phases a and b and an encoder.
  bool is_wide() const noexcept { return has_more() || field_current || speed_sensors || hall; }
  /// 1 a, 2 b, 4 c, 8 field.
  std::uint64_t bits() const noexcept {
    return 1u | (has_b() ? 2u : 0u) | (has_c() ? 4u : 0u) | (field ? 8u : 0u);
  }

  /// The duties of a command from those that count the legs of a star from the middle of the link, -1 to 1.
  PhaseValues duties_from_middle(const PhaseValues& d) const noexcept {
    if (connection != Connection::kStar) return d;
    return {.a = 0.5 + 0.5 * d.a, .b = 0.5 + 0.5 * d.b, .c = 0.5 + 0.5 * d.c, .field = d.field};
  }
};

/// The words of descriptions for the connection of the phases, and for the kind of drive.
constexpr std::string_view word_of(Connection connection) noexcept {
  constexpr std::array<std::string_view, 4> kWords = {"two_phase", "star", "independent", "armature"};
  return kWords[static_cast<std::size_t>(connection)];
}
inline std::string_view drive_word_of(const AxisParameters& p) noexcept {
  const Parameter* const row = find_parameter(p, "drive.kind");
  return row->words[static_cast<std::size_t>(row->get(p))];
}

inline Terminals terminals_of(const AxisParameters& p) {
  const SensorParameters& sensors = p.sensors;
  const FieldSupply field = kind_of(p.machine).field;
  return {.connection = connection_of(p.machine),
          .field = field == FieldSupply::kOwnTerminals,
          .field_current = field != FieldSupply::kNone,
          .speed_sensors = sensors.tachometer.analog.enabled || sensors.resolver.analog.enabled,
          .hall = sensors.hall.enabled};
}

}  // namespace drivebench
