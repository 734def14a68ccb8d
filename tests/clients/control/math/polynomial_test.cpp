#include "clients/control/math/polynomial.hpp"

#include <gtest/gtest.h>

#include <array>

namespace drivebench::control::polynomial_test {
namespace {

// Catches: coefficients read from the wrong end and lost complex roots: (x - 2)·(x² + 2x + 5), -1 ± 2j.
TEST(Polynomial, RootsOfACubic) {
  double nearest_real = 1e9;
  std::complex<double> sum = 0.0;
  const std::vector<std::complex<double>> found = roots(std::array{-10.0, 1.0, 0.0, 1.0});
  ASSERT_EQ(found.size(), 3U);
  for (const auto& x : found) {
    nearest_real = std::min(nearest_real, std::abs(x - 2.0));
    sum += x;
    EXPECT_LT(std::abs(x * x * x + x - 10.0), 1e-12);
  }
  EXPECT_LT(nearest_real, 1e-12);
  EXPECT_LT(std::abs(sum), 1e-12);
}

// Catches: an iteration without scaling, whose squares overflow, and a small root that is lost beside a large
// one.
TEST(Polynomial, RootsMayBeLargeAndFarApart) {
  const std::vector<double> found = real_roots(std::array{3e120 * 7e110, 3e120 + 7e110, 1.0});
  ASSERT_EQ(found.size(), 2U);
  EXPECT_NEAR(found[0], -3e120, 3e120 * 1e-12);
  EXPECT_NEAR(found[1], -7e110, 7e110 * 1e-9);
}

// Catches: a division by a root at zero, a zero leading coefficient, and a filter that lets complex roots
// pass: x²·(x + 1)·(x² + 1) has the real roots -1, 0 and 0.
TEST(Polynomial, RealRootsOnlyWithTheirMultiplicity) {
  const std::vector<double> found = real_roots(std::array{0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.0});
  ASSERT_EQ(found.size(), 3U);
  EXPECT_NEAR(found[0], -1.0, 1e-12);
  EXPECT_EQ(found[1], 0.0);
  EXPECT_EQ(found[2], 0.0);
}

// Catches: a tolerance that drops a double root because it was found as a pair beside the axis: (x - 3)²·(x +
// 1).
TEST(Polynomial, ADoubleRootStaysReal) {
  const std::vector<double> found = real_roots(std::array{9.0, 3.0, -5.0, 1.0});
  ASSERT_EQ(found.size(), 3U);
  EXPECT_NEAR(found[0], -1.0, 1e-12);
  EXPECT_NEAR(found[1], 3.0, 1e-6);
  EXPECT_NEAR(found[2], 3.0, 1e-6);
}

}  // namespace
}  // namespace drivebench::control::polynomial_test
