#include "clients/identification/math/least_squares.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

namespace drivebench::identification::least_squares_test {
namespace {

// A line through points with a known answer: estimate, E^2 and both indices by hand. R_W = [4 6; 6 14], E^2
// = 1.8 and (R_W^-1)_22 = 4/20. Catches: an index without its square root, E^2/n in its place, R_y without
// the mean.
TEST(LeastSquares, ALineByHand) {
  Regression fit({"offset", "slope"});
  const double y[] = {0.0, 2.0, 1.0, 4.0};
  for (int k = 0; k < 4; ++k)
    fit.add(std::array{1.0, static_cast<double>(k)}, y[k]);
  const LeastSquares found = fit.solve();
  EXPECT_NEAR(found.estimate[0], 0.1, 1e-12);
  EXPECT_NEAR(found.estimate[1], 1.1, 1e-12);
  EXPECT_NEAR(found.residual, 2.7, 1e-12);
  EXPECT_NEAR(found.energy, 21.0, 1e-12);
  EXPECT_NEAR(found.error_index, std::sqrt(2.7 / 21.0), 1e-12);
  EXPECT_NEAR(found.index_double[1], std::sqrt(2.7 * 4.0 / 20.0), 1e-12);
  EXPECT_NEAR(found.index_quarter[1], 0.5 * found.index_double[1], 1e-15);
  const double root = std::sqrt(61.0);
  EXPECT_NEAR(found.normal_condition, (9.0 + root) / (9.0 - root), 1e-9);
  EXPECT_TRUE(found.excitation.sufficient);
}

// E^2 really doubles at the index: the others are free to follow. Catches: an index along the axis, which is
// too short.
TEST(LeastSquares, TheErrorDoublesAtTheIndex) {
  std::mt19937 engine(3);
  std::normal_distribution<double> noise;
  Regression fit({"a", "b", "c"});
  Regression moved({"a", "b"});
  std::vector<std::array<double, 4>> rows;
  for (int k = 0; k < 200; ++k) {
    const double x = noise(engine);
    rows.push_back({x, x + 0.5 * noise(engine), noise(engine), 0.0});
    rows.back()[3] = 2.0 * rows.back()[0] - rows.back()[1] + 3.0 * rows.back()[2] + noise(engine);
    fit.add(std::span(rows.back()).first(3), rows.back()[3]);
  }
  const LeastSquares found = fit.solve();
  const double c = found.estimate[2] + found.index_double[2];
  for (const auto& row : rows)
    moved.add(std::span(row).first(2), row[3] - c * row[2]);
  EXPECT_NEAR(moved.solve().residual, 2.0 * found.residual, 1e-9 * found.residual);
}

// Columns of lengths 1 and 1e9 whose angle is 1e-6: the normal equations have a condition of 1e30 and no
// digit left; QR with scaled columns keeps six. Catches: normal equations, a condition of unscaled columns.
TEST(LeastSquares, ReflectionsKeepTheDigits) {
  Regression fit({"small", "large"});
  for (int k = 0; k < 1000; ++k) {
    const double t = 0.01 * k;
    const double small = std::sin(t);
    const double large = 1e9 * (std::sin(t) + 1e-6 * std::cos(3.0 * t));
    fit.add(std::array{small, large}, 2.0 * small + 3e-9 * large);
  }
  const LeastSquares found = fit.solve({.condition = 1e8});
  EXPECT_NEAR(found.estimate[0], 2.0, 1e-6);
  EXPECT_NEAR(found.estimate[1], 3e-9, 1e-15);
  EXPECT_LT(found.condition, 1e7);
  EXPECT_TRUE(found.excitation.sufficient);
}

// b and c only as their sum: both are named, a is not, and a parameter without any data neither escapes.
// Catches: a verdict that blames all or none.
TEST(LeastSquares, TheVerdictNamesTheParametersThatTheDataLeaveOpen) {
  Regression fit({"a", "b", "c"});
  Regression silent({"a", "b"});
  for (int k = 0; k < 300; ++k) {
    const double t = 0.1 * k;
    fit.add(std::array{std::sin(t), std::cos(t), 1e3 * std::cos(t)}, std::sin(t));
    silent.add(std::array{std::sin(t), 0.0}, std::sin(t));
  }
  const Excitation pair = fit.solve().excitation;
  EXPECT_FALSE(pair.sufficient);
  EXPECT_EQ(pair.unseen, (std::vector<std::string>{"b", "c"}));
  EXPECT_EQ(pair.verdict, "not identifiable: the data do not tell b and c from each other");
  const LeastSquares found = silent.solve();
  EXPECT_EQ(found.excitation.unseen, (std::vector<std::string>{"b"}));
  EXPECT_EQ(found.excitation.verdict, "not identifiable: the data do not tell b");
  EXPECT_NEAR(found.estimate[0], 1.0, 1e-12);
}

// Folding blocks must not change the answer: 10 000 rows against the closed form of a mean. Catches: rows
// lost at the border of a block, rows counted twice.
TEST(LeastSquares, LongRecordsAreFoldedIntoTheFactor) {
  Regression fit({"mean"});
  for (int k = 0; k < 10007; ++k)
    fit.add(std::array{1.0}, k);
  const LeastSquares found = fit.solve();
  EXPECT_NEAR(found.estimate[0], 5003.0, 1e-8);
  const double n = 10007.0;
  EXPECT_NEAR(found.residual, n * (n * n - 1.0) / 12.0, 1e-9 * n * n * n);
  EXPECT_EQ(fit.rows(), 10007U);
}

// Catches: an answer from nothing, NaN that goes round as a result.
TEST(LeastSquares, TooFewOrBrokenDataAreRefused) {
  Regression fit({"a", "b"});
  fit.add(std::array{1.0, 2.0}, 1.0);
  EXPECT_THROW(fit.solve(), IdentificationError);
  fit.add(std::array{1.0, std::nan("")}, 1.0);
  EXPECT_THROW(fit.solve(), IdentificationError);
}

}  // namespace
}  // namespace drivebench::identification::least_squares_test
