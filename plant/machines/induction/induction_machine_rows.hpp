#pragma once

#include <span>

#include "plant/parameters/parameters.hpp"

namespace drivebench {

/// The parameters of kind InductionMachine.
std::span<const Parameter> induction_machine_rows() noexcept;

/// Appends what is wrong between the values.
void add_problems(const InductionMachineParameters& p, Problems& found);

}  // namespace drivebench
