#pragma once

#include <span>

#include "plant/parameters/parameters.hpp"

namespace drivebench {

/// The parameters of section mechanics.
std::span<const Parameter> mechanics_rows() noexcept;
std::span<const CurveParameter> mechanics_curves() noexcept;

/// Appends what is wrong between the values, each of which lies within the limits of its row.
void add_problems(const MechanicsParameters& p, Problems& found);

}  // namespace drivebench
