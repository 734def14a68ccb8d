#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "protocols/can/budget.hpp"
#include "server/config/config.hpp"

namespace drivebench {

/// The description of an interface of this bench: "dbc" or "can-table" of a bus, counted from 1 (without any
/// [[can]], of the default profile), "modbus-map" (Markdown) or "modbus-csv". Throws std::runtime_error if
/// there is no such bus.
std::string interface_text(const BenchConfig& config, std::string_view what, std::size_t bus);

/// What a bus must carry while this bench runs in real time.
can::BusLoad bus_load_of(const BenchConfig& config, const CanConfig& bus);

/// One sentence for each bus that cannot carry its frames in real time with the worst bit stuffing, and how
/// it could.
std::vector<std::string> bus_overloads(const BenchConfig& config);

}  // namespace drivebench
