#pragma once

#include <span>

#include "plant/parameters/parameters.hpp"

namespace drivebench {

/// Section [axis.machine] of this kind.
std::span<const Parameter> linear_dc_machine_rows() noexcept;

/// The rules between the values.
void add_problems(const LinearDcMachineParameters& p, Problems& found);

}  // namespace drivebench
