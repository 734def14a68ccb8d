#pragma once

#include <string>
#include <vector>

#include "protocols/modbus/register_map.hpp"
#include "server/config.hpp"

namespace drivebench::modbus {

/// The parameters of an axis as the register map wants them.
std::vector<ParameterInfo> parameter_infos();

/// The register map of this bench, as CSV or as Markdown.
std::string map_of(const BenchConfig& config, bool csv);

}  // namespace drivebench::modbus
