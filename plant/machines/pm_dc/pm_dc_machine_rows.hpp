#pragma once

#include <span>

#include "plant/parameters/parameters.hpp"

namespace drivebench {

/// Section [axis.machine] of this kind.
std::span<const Parameter> pm_dc_machine_rows() noexcept;

/// The rules between the values.
void add_problems(const PmDcMachineParameters& p, Problems& found);

}  // namespace drivebench
