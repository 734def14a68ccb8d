#include "clients/identification/math/elimination.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>

#include "clients/identification/math/real_roots.hpp"

namespace drivebench::identification::elimination_test {
namespace {

using Complex = std::complex<double>;
using InX1 = Polynomial<double>;
using InX2 = Polynomial<InX1>;

// Case 25: a = x2^2 + x2 + x1, b = -x1 x2^2 + x2 + 1: r = (3 + x1^2) x1^2, and its roots are the common zeros
// of the text. Catches: Sylvester's rows with a sign or a shift wrong.
TEST(Elimination, TheBooksExample) {
  const InX1 x1(std::vector<double>{0.0, 1.0});
  const InX2 a(std::vector<InX1>{x1, 1, 1});
  const InX2 b(std::vector<InX1>{1, 1, -x1});
  const InX1 r = resultant(a, b);
  EXPECT_EQ(r.coefficients(), (std::vector<double>{0.0, 0.0, 3.0, 0.0, 1.0}));
  const double root3 = std::sqrt(3.0);
  const Complex zeros[][2] = {{0.0, -1.0},
                              {Complex(0.0, root3), Complex(0.5, -0.5 * root3)},
                              {Complex(0.0, -root3), Complex(0.5, 0.5 * root3)}};
  for (const auto& zero : zeros) {
    const auto value = [&](const InX2& p) {
      Complex sum = 0.0;
      for (std::size_t i = p.coefficients().size(); i-- > 0;)
        sum = sum * zero[1] + p.coefficients()[i].at(zero[0]);
      return std::abs(sum);
    };
    EXPECT_LT(std::abs(r.at(zero[0])), 1e-9);
    EXPECT_LT(value(a), 1e-9);
    EXPECT_LT(value(b), 1e-9);
  }
}

// Both leading coefficients vanish at x1 = 0 though a = x1 x2 + 1 and b = x1 x2 + 2 have no common zero: the
// resultant is zero there all the same. Catches: the belief that the converse needs no condition.
TEST(Elimination, VanishingLeadingCoefficientsAreZerosToo) {
  const InX1 x1(std::vector<double>{0.0, 1.0});
  const InX1 r = resultant(InX2(std::vector<InX1>{1, x1}), InX2(std::vector<InX1>{2, x1}));
  EXPECT_EQ(r.at(0.0), 0.0);
  EXPECT_EQ(r.degree(), 1);
}

// Exact for matrices that elimination in doubles gets wrong: rows of Hilbert-like whole numbers, and a zero
// pivot. Catches: a division on the way, a sign of odd sizes.
TEST(Elimination, DeterminantsWithoutDivision) {
  EXPECT_EQ(determinant(SquareMatrix<double>{{0, 1, 0}, {1, 0, 0}, {0, 0, 5}}), -5.0);
  EXPECT_EQ(determinant(SquareMatrix<Whole>{{2, 3, 1, 7}, {4, 1, 5, 2}, {6, 4, 6, 9}, {1, 1, 1, 1}}),
            Whole(0));
  EXPECT_EQ(determinant(SquareMatrix<Whole>{{2, 3, 1, 7}, {4, 1, 5, 2}, {6, 0, 6, 9}, {1, 1, 1, 2}}),
            Whole(12));
}

WholePolynomial with_roots(std::initializer_list<int> roots) {
  WholePolynomial p(Whole(1));
  for (const int root : roots)
    p = p * WholePolynomial(std::vector<Whole>{Whole(-root), Whole(1)});
  return p;
}

// Positive roots with their direction; negative, zero and complex ones do not count. Catches: a lost part of
// the interval, a bound below the largest root.
TEST(RealRoots, AllPositiveRootsAndNoOthers) {
  const WholePolynomial complex_pair(std::vector<Whole>{Whole(5), Whole(-4), Whole(1)});  // 2 +- j
  const PositiveRoots found = positive_roots(with_roots({-7, 0, 1, 3, 1000, 1001}) * complex_pair);
  ASSERT_TRUE(found.complete);
  ASSERT_EQ(found.roots.size(), 4U);
  const double expected[] = {1.0, 3.0, 1000.0, 1001.0};
  for (std::size_t k = 0; k < 4; ++k) {
    EXPECT_DOUBLE_EQ(found.roots[k].value, expected[k]);
    EXPECT_LE(found.roots[k].low, expected[k]);
    EXPECT_GE(found.roots[k].high, expected[k]);
    EXPECT_EQ(found.roots[k].falling, k % 2 == 0) << k;  // positive between 0 and the first of four
  }
  EXPECT_TRUE(positive_roots(complex_pair).roots.empty());
}

// Wilkinson's polynomial to degree 20: its roots to the last bit, where doubles are off by 0.5. Catches:
// arithmetic that rounds.
TEST(RealRoots, WilkinsonsPolynomial) {
  const PositiveRoots found =
      positive_roots(with_roots({1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20}));
  ASSERT_EQ(found.roots.size(), 20U);
  for (std::size_t k = 0; k < 20; ++k)
    EXPECT_DOUBLE_EQ(found.roots[k].value, static_cast<double>(k + 1));
}

// Catches: a double root that is taken for none or for one without a word.
TEST(RealRoots, ADoubleRootIsReported) {
  EXPECT_FALSE(positive_roots(with_roots({3, 3})).complete);
  const WholePolynomial third(
      std::vector<Whole>{Whole(-1), Whole(3)});  // 1/3 is never the middle of an interval
  EXPECT_FALSE(positive_roots(third * third).complete);
  EXPECT_TRUE(positive_roots(with_roots({-3, -3})).complete);
}

}  // namespace
}  // namespace drivebench::identification::elimination_test
