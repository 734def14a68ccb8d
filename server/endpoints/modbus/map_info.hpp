#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "protocols/modbus/register_map.hpp"
#include "server/config/config.hpp"

namespace drivebench::modbus {

/// The row in axis_parameters() of each parameter in the map of an axis. The parameters of the first map keep
/// their places; the others follow in the order of the table, which depends on the kind of machine.
std::vector<std::uint32_t> parameter_rows(const AxisParameters& axis);

/// The parameters of an axis for the register map, in that order.
std::vector<ParameterInfo> parameter_infos(const AxisParameters& axis);

/// The maps of all axes.
std::vector<RegisterMap> maps_of(const BenchConfig& config);

/// The register map of this bench, as CSV or as Markdown.
std::string map_of(const BenchConfig& config, bool csv);

}  // namespace drivebench::modbus
