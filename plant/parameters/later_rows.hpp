#pragma once

#include <span>

#include "plant/parameters/parameters.hpp"

namespace drivebench {

/// Parameters that came when runs had been recorded, whatever their section: at the end of the table, so that
/// the registers of the others stay where they are, and left out of hashes while they are 0.
std::span<const Parameter> later_rows() noexcept;

/// Their rules with other values.
void add_later_problems(const AxisParameters& p, Problems& found);

/// The rules with the sample period.
void add_period_problems(const AxisParameters& p, double period_s, Problems& found);

}  // namespace drivebench
