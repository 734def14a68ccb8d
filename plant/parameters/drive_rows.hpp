#pragma once

#include <span>

#include "plant/parameters/parameters.hpp"

namespace drivebench {

/// Sections [axis.drive], [axis.amplifier], [axis.current_loop], [axis.inverter], [axis.bus] and
/// [axis.source].
std::span<const Parameter> drive_rows() noexcept;
std::span<const CurveParameter> drive_curves() noexcept;

/// Whether a parameter is one of DriveParameters.
bool is_of_drive(std::string_view parameter) noexcept;

/// The rules between the values.
void add_problems(const DriveParameters& p, Problems& found);

/// The rules for a drive on which two machines hang.
void add_shared_problems(const DriveParameters& p, Problems& found);

/// The rules that need the sample period.
void add_period_problems(const DriveParameters& p, double period_s, Problems& found);

}  // namespace drivebench
