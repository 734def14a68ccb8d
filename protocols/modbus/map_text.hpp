#pragma once

#include <span>
#include <string>
#include <string_view>

#include "protocols/modbus/register_map.hpp"

namespace drivebench::modbus {

/// A fault bit that has a name, with its discrete input.
struct FaultInput {
  std::size_t address;
  Bit bit;
};

/// The map as a table for spreadsheets and PLC tools: one line for each value, coil and discrete
/// input. The first column says which of these; the address alone does not.
std::string map_csv(const RegisterMap& map, std::span<const FaultInput> faults);

/// The map for people, with the rules that a table cannot hold.
std::string map_markdown(const RegisterMap& map, std::span<const FaultInput> faults,
                         std::span<const std::string_view> axes);

}  // namespace drivebench::modbus
