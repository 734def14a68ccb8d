#pragma once

#include <span>
#include <string>
#include <string_view>

#include "protocols/modbus/register_map.hpp"

namespace drivebench::modbus {

/// A bit of the fault word, or of the injected faults, that has a name, with its discrete input.
struct FaultInput {
  std::size_t address;
  Bit bit;
};

/// The maps of the axes as a table for spreadsheets and PLC tools: one line for each value, coil and discrete
/// input. The first column says which of these; the address alone does not, nor does it say whose parameter
/// it is where the axes have different kinds of machines.
std::string map_csv(std::span<const RegisterMap> maps, std::span<const FaultInput> faults);

/// The maps for people, with the rules that a table cannot hold.
std::string map_markdown(std::span<const RegisterMap> maps, std::span<const FaultInput> faults,
                         std::span<const std::string_view> axes);

}  // namespace drivebench::modbus
