#pragma once

#include <span>

#include "plant/parameters/parameters.hpp"

namespace drivebench {

/// Section [axis.machine] of this kind.
std::span<const Parameter> shunt_dc_machine_rows() noexcept;
std::span<const CurveParameter> shunt_dc_machine_curves() noexcept;

/// The rules between the values.
void add_problems(const ShuntDcMachineParameters& p, Problems& found);

}  // namespace drivebench
