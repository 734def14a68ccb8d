#pragma once

#include <span>
#include <vector>

#include "plant/parameters/parameters.hpp"

namespace drivebench {

/// Section [axis.machine] of this kind.
std::span<const Parameter> bldc_machine_rows() noexcept;

/// The rules between the values.
void add_problems(const BldcMachineParameters& p, std::vector<Problem>& found);

}  // namespace drivebench
