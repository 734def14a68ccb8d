#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "protocols/can/budget.hpp"
#include "server/config/config.hpp"

namespace drivebench {

/// The description of an interface of this bench: "dbc" or "can-table" of a bus, counted from 1 (without
/// [[can]] sections: of the default profile), "modbus-map" (Markdown) or "modbus-csv". Throws
/// std::runtime_error if the bus does not exist.
std::string interface_text(const BenchConfig& config, std::string_view what, std::size_t bus);

/// The load of a bus while this bench runs in real time.
can::BusLoad bus_load_of(const BenchConfig& config, const CanConfig& bus);

/// A sentence with a cure for each bus that cannot carry its frames in real time with the worst bit stuffing.
std::vector<std::string> bus_overloads(const BenchConfig& config);

}  // namespace drivebench
