#pragma once

#include <span>

#include "plant/parameters/parameters.hpp"

namespace drivebench {

/// Section [axis.machine] of this kind.
std::span<const Parameter> saturated_induction_machine_rows() noexcept;
std::span<const CurveParameter> saturated_induction_machine_curves() noexcept;

/// The rules between the values.
void add_problems(const SaturatedInductionMachineParameters& p, Problems& found);

}  // namespace drivebench
