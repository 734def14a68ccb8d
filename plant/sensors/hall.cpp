#include "plant/sensors/hall.hpp"

#include <array>
#include <cstddef>

#include "plant/math/rounding.hpp"

namespace drivebench {
namespace {

constexpr double kSectorsPerRad = 0x1.e8ec8a4aeacc4p-1;  // 3/pi

/// The bit of line 1, 2 or 3; no bit for 0.
constexpr std::uint32_t line_bit(double line) noexcept {
  return line > 0.0 ? 1u << static_cast<std::uint32_t>(line - 1.0) : 0u;
}

}  // namespace

std::uint32_t hall_lines(const HallParameters& p, const InjectedFaults& faults,
                         double electrical_rad) noexcept {
  if (!p.enabled) return 0;
  const double angle_rad = electrical_rad - (p.offset_rad + faults.hall_offset);
  return hall_lines_in(floor_to_integer(angle_rad * kSectorsPerRad + 0.5), faults);
}

std::uint32_t hall_lines_in(std::int64_t sector, const InjectedFaults& faults) noexcept {
  constexpr std::array<std::uint32_t, 6> kLines{5, 1, 3, 2, 6, 4};
  sector %= 6;
  const std::uint32_t lines = kLines[static_cast<std::size_t>(sector < 0 ? sector + 6 : sector)];
  return (lines | line_bit(faults.hall_stuck_high)) & ~line_bit(faults.hall_stuck_low);
}

}  // namespace drivebench
