#pragma once

#include <span>

#include "plant/parameters/parameters.hpp"

namespace drivebench {

/// Section [axis.transformer]. The table stands behind all others, so that the Modbus registers of their
/// parameters stay where they are.
std::span<const Parameter> transformer_rows() noexcept;

/// The rules between the values of a transformer and those of its source.
void add_transformer_problems(const DriveParameters& p, Problems& found);

}  // namespace drivebench
