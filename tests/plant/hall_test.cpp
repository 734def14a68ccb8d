#include "plant/sensors/hall.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

namespace drivebench::hall_test {
namespace {

constexpr HallParameters kHall{.enabled = true};
constexpr double kDegree_rad = std::numbers::pi / 180.0;

std::uint32_t lines_at(double degrees, const HallParameters& p = kHall, const InjectedFaults& faults = {}) {
  return hall_lines(p, faults, degrees * kDegree_rad);
}

// BL-03: the commutation angles are 30, 90, ... 330 degrees. Catches: sectors from 0, an order of the codes
// that belongs to the other direction, two lines exchanged, a code that skips a sector in a later or negative
// turn.
TEST(Hall, TheLinesChangeAtTheCommutationAnglesInTheOrderOfForwardRotation) {
  constexpr std::array<std::uint32_t, 6> kForward{5, 1, 3, 2, 6, 4};
  for (int turn = -3; turn <= 5; ++turn) {
    for (int sector = 0; sector < 6; ++sector) {
      const double start = 360.0 * turn - 30.0 + 60.0 * sector;
      for (const double within : {1e-6, 15.0, 45.0, 60.0 - 1e-6})
        EXPECT_EQ(lines_at(start + within), kForward[static_cast<std::size_t>(sector)]) << start + within;
    }
  }
}

// Catches: lines that are not high for half a turn, or not 120 degrees apart.
TEST(Hall, EachLineIsHighForHalfATurnAndAThirdOfATurnBehindTheOneBefore) {
  for (int line = 0; line < 3; ++line) {
    for (int degree = 0; degree < 360; ++degree) {
      const double phase = std::remainder(degree + 0.5 - 120.0 * line - 60.0, 360.0);  // from its middle
      EXPECT_EQ((lines_at(degree + 0.5) >> line & 1u) != 0, std::abs(phase) < 90.0) << degree;
    }
  }
}

// Catches: an offset or a fault of the wrong sign, one that replaces the other.
TEST(Hall, ADisplacementMovesTheEdgesForward) {
  const HallParameters displaced{.enabled = true, .offset_rad = 10.0 * kDegree_rad};
  EXPECT_EQ(lines_at(39.0, displaced), 5u);
  EXPECT_EQ(lines_at(41.0, displaced), 1u);
  const InjectedFaults fault{.hall_offset = -15.0 * kDegree_rad};
  EXPECT_EQ(lines_at(24.0, displaced, fault), 5u);
  EXPECT_EQ(lines_at(26.0, displaced, fault), 1u);
}

// Catches: the wrong line stuck, a stuck line that takes the others along, high and low exchanged.
TEST(Hall, AStuckLineStaysAndTheOthersGoOn) {
  for (int line = 1; line <= 3; ++line) {
    const InjectedFaults low{.hall_stuck_low = static_cast<double>(line)};
    const InjectedFaults high{.hall_stuck_high = static_cast<double>(line)};
    const std::uint32_t bit = 1u << (line - 1);
    for (int degree = 0; degree < 360; degree += 20) {
      const std::uint32_t sound = lines_at(degree);
      EXPECT_EQ(lines_at(degree, kHall, low), sound & ~bit);
      EXPECT_EQ(lines_at(degree, kHall, high), sound | bit);
    }
  }
}

// Catches: lines of a sensor that is not there.
TEST(Hall, ASensorThatIsOffReadsZero) {
  EXPECT_EQ(lines_at(60.0, {}, {.hall_stuck_high = 2.0}), 0u);
}

}  // namespace
}  // namespace drivebench::hall_test
