#pragma once

#include <array>
#include <cstdint>
#include <optional>

namespace drivebench::control {

/// One value for each phase of a star.
using Phases = std::array<double, 3>;

/// The sector, 0 to 5, of an electrical angle; sector 0 is −30° to 30°, and each has 60°.
int commutation_sector(double electrical_rad) noexcept;

/// The same from Hall lines that change where the sectors do (bit 0 high from −30° to 150°, bits 1 and 2
/// 120° and 240° later); nothing for the two words that no sound sensor gives.
std::optional<int> commutation_sector(std::uint64_t hall_lines) noexcept;

/// Phase currents for a torque of 2·τ_p: against e in the two phases where it is at its top, none in the
/// third. Their sum is 0. Source: the book, (10.10) (BL-03).
Phases commutation_currents(int sector) noexcept;

/// e(n_p·θ) of the three phases.
Phases trapezoids(double electrical_rad) noexcept;

}  // namespace drivebench::control
