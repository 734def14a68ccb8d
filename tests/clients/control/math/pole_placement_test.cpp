#include "clients/control/math/pole_placement.hpp"

#include <gtest/gtest.h>

#include <array>

namespace drivebench::control::pole_placement_test {
namespace {

// Catches: a coefficient with a missing or double product: the sums of products of 2, 3 and 5 are known.
TEST(PolePlacement, CoefficientsAreTheSumsOfProductsOfThePoles) {
  EXPECT_EQ(placed_polynomial<1>({7.0}), (Polynomial<1>{7.0}));
  EXPECT_EQ(placed_polynomial<3>({2.0, 3.0, 5.0}), (Polynomial<3>{10.0, 31.0, 30.0}));
  EXPECT_EQ(placed_polynomial<3>({100.0, 100.0, 100.0}), (Polynomial<3>{300.0, 3e4, 1e6}));
  // (s + 10)(s^2 + 20 s + 200): the poles -10, -10 +- j10 of the book's design with a tachometer.
  EXPECT_EQ(placed_polynomial(10.0, 0.5, 20.0), (Polynomial<3>{30.0, 600.0, 4000.0}));
}

// Catches: a Routh table that takes the wrong rows: the book's own loops, of which s^3 + s^2 + 1 has roots at
// 0.23 +- j0.79 (the print has a minus there), and a loop with as many unstable roots as stable ones.
TEST(PolePlacement, RouthTellsStableLoopsFromUnstableOnes) {
  EXPECT_TRUE(is_hurwitz(Polynomial<3>{300.0, 3e4, 1e6}));
  EXPECT_FALSE(is_hurwitz(Polynomial<3>{1.0, 0.0, 1.0}));
  EXPECT_TRUE(is_hurwitz(Polynomial<3>{1.0, 1.0, 0.5}));    // PI, K = 1, a = 0.5
  EXPECT_FALSE(is_hurwitz(Polynomial<3>{1.0, 1.0, 1.01}));  // and beyond its limit a < 1
  EXPECT_TRUE(is_hurwitz(Polynomial<4>{10.0, 35.0, 50.0, 24.0}));
  EXPECT_FALSE(is_hurwitz(Polynomial<4>{2.0, 3.0, 4.0, 5.0}));
  EXPECT_FALSE(is_hurwitz(Polynomial<2>{3.0, 0.0}));
}

// Catches: a Jury recursion that divides or reverses wrongly: (z - 0.5)(z - 0.9)(z + 0.3) and the same with
// one root outside.
TEST(PolePlacement, JuryTellsRootsInsideTheUnitCircle) {
  EXPECT_TRUE(is_schur(Polynomial<3>{-1.1, 0.03, 0.135}));
  EXPECT_FALSE(is_schur(Polynomial<3>{-1.3, 0.13, 0.165}));  // 1.1 for 0.9
  EXPECT_TRUE(is_schur(Polynomial<2>{-1.5, 0.5625}));
  EXPECT_FALSE(is_schur(Polynomial<2>{0.0, 1.0}));
}

}  // namespace
}  // namespace drivebench::control::pole_placement_test
