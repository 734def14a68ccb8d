#pragma once

#include <span>
#include <string>
#include <string_view>

#include "protocols/modbus/register_map.hpp"

namespace drivebench::modbus {

/// A named bit of the fault word or of the injected faults, with its discrete input.
struct FaultInput {
  std::size_t address;
  Bit bit;
};

/// The maps of the axes as a CSV table for spreadsheets and PLC tools: one line for each value, coil and
/// discrete input. The first column names the table of an address, and the axis where axes have different
/// kinds of machines.
std::string map_csv(std::span<const RegisterMap> maps, std::span<const FaultInput> faults);

/// The maps in Markdown, with the rules for taking an axis, for commands and for exceptions.
std::string map_markdown(std::span<const RegisterMap> maps, std::span<const FaultInput> faults,
                         std::span<const std::string_view> axes);

}  // namespace drivebench::modbus
