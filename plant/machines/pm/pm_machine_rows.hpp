#pragma once

#include <span>

#include "plant/parameters/parameters.hpp"

namespace drivebench {

/// The parameters of kind PmMachine.
std::span<const Parameter> pm_machine_rows() noexcept;

/// Appends what is wrong between the values, each of which lies within the limits of its row.
void add_problems(const PmMachineParameters& p, Problems& found);

}  // namespace drivebench
