#include "clients/control/synchronous/bldc_commutation.hpp"

#include <cmath>
#include <numbers>

#include "clients/models/bldc_machine.hpp"

namespace drivebench::control {

int commutation_sector(double electrical_rad) noexcept {
  const double sector = std::floor(electrical_rad / (std::numbers::pi / 3.0) + 0.5);
  const double within_turn = sector - 6.0 * std::floor(sector / 6.0);
  // An estimate that has run away, to infinity or beyond what a double resolves, is in no sector.
  return within_turn >= 0.0 && within_turn < 6.0 ? static_cast<int>(within_turn) : 0;
}

std::optional<int> commutation_sector(std::uint64_t hall_lines) noexcept {
  constexpr int kNone = -1;
  constexpr std::array<int, 8> kSectors{kNone, 1, 3, 2, 5, 0, 4, kNone};
  if (hall_lines >= kSectors.size() || kSectors[hall_lines] == kNone) return std::nullopt;
  return kSectors[hall_lines];
}

Phases commutation_currents(int sector) noexcept {
  constexpr std::array<Phases, 6> kTable{
      {{0, 1, -1}, {-1, 1, 0}, {-1, 0, 1}, {0, -1, 1}, {1, -1, 0}, {1, 0, -1}}};
  return kTable[static_cast<std::size_t>(sector)];
}

Phases trapezoids(double electrical_rad) noexcept {
  const double turns = electrical_rad / (2.0 * std::numbers::pi);
  return {trapezoid_at_turns(turns), trapezoid_at_turns(turns - 1.0 / 3.0),
          trapezoid_at_turns(turns - 2.0 / 3.0)};
}

}  // namespace drivebench::control
