#include "clients/models/winding_factors.hpp"

#include <gtest/gtest.h>

#include <array>
#include <numbers>
#include <vector>

namespace drivebench::winding_factors_test {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

// GEN-01 to the printed digits. Catches: mechanical for electrical angles, a belt of 2 pi/m instead of pi/m.
TEST(WindingFactors, AreThoseOfTheBook) {
  constexpr std::array kEven = {0.6366, 0.9003, 0.9549, 0.9745};
  for (int m = 1; m <= 4; ++m)
    EXPECT_NEAR(even_distribution_factor(m, 1), kEven.at(static_cast<std::size_t>(m - 1)), 5e-5);
  EXPECT_NEAR(distribution_factor(std::array{-30.0 * kDegree, 0.0, 30.0 * kDegree}, 1), 0.9107, 5e-5);
  // Two layers in 12 slots of 2 poles: two slots of 30 degrees, coils that span 5 of 6.
  EXPECT_NEAR(distribution_factor(std::array{0.0, 30.0 * kDegree}, 1) * pitch_factor(5.0 / 6.0, 1), 0.9330,
              5e-5);
  // One layer in 24 slots: four of 15 degrees.
  std::vector<double> four;
  for (int k = 0; k < 4; ++k)
    four.push_back(15.0 * kDegree * k);
  EXPECT_NEAR(distribution_factor(four, 1), 0.9577, 5e-5);
  EXPECT_NEAR(4.0 * distribution_factor(four, 1), 3.8306, 5e-5);
}

// Many loops in a belt come to the even one; a pitch of 4/5 has no fifth harmonic, one of 2/3 no third.
// Catches: a harmonic that is left out of one of the angles.
TEST(WindingFactors, HarmonicsFollowTheirAngles) {
  for (const int harmonic : {1, 3, 5, 7}) {
    std::vector<double> many;
    for (int k = 0; k < 10'000; ++k)
      many.push_back(60.0 * kDegree * (k + 0.5) / 10'000);
    EXPECT_NEAR(distribution_factor(many, harmonic), even_distribution_factor(3, harmonic), 1e-6);
  }
  EXPECT_NEAR(pitch_factor(0.8, 5), 0.0, 1e-15);
  EXPECT_NEAR(pitch_factor(2.0 / 3.0, 3), 0.0, 1e-15);
  EXPECT_NEAR(pitch_factor(1.0, 1), 1.0, 1e-15);
}

}  // namespace
}  // namespace drivebench::winding_factors_test
