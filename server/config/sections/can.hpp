#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "protocols/can/profile.hpp"
#include "server/config/config.hpp"
#include "server/config/strict_table.hpp"

namespace drivebench {

/// Reads all [[can]] sections. `nodes`: of the axes. `wide`: the bench has a wide axis, whose frames need
/// identifiers too.
std::vector<CanConfig> read_can(StrictTable& root, std::span<const std::uint32_t> nodes, bool wide);

/// A row for each Message. Rows of one message have the same name and the same use of the node id.
inline constexpr auto kCanMessages = [] {
  std::array<const can::MessageRow*, can::kMessageCount> rows{};
  for (const can::MessageRow& row : can::kMessages)
    rows[static_cast<std::size_t>(row.message)] = &row;
  return rows;
}();

/// The keys of [can.units].
struct CanUnitKey {
  std::string_view key;
  double can::Profile::*unit;
};
inline constexpr std::array<CanUnitKey, 5> kCanUnits{{{"current_a", &can::Profile::current_unit_a},
                                                      {"voltage_v", &can::Profile::voltage_unit_v},
                                                      {"bus_voltage_v", &can::Profile::bus_voltage_unit_v},
                                                      {"speed_rad_s", &can::Profile::speed_unit_rad_s},
                                                      {"edge_time_s", &can::Profile::edge_time_unit_s}}};

}  // namespace drivebench
