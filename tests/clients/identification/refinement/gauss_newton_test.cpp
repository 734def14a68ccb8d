#include "clients/identification/refinement/gauss_newton.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "tests/repetitions.hpp"

namespace drivebench::identification::gauss_newton_test {
namespace {

constexpr int kRows = 6400;

/// y = e^(a t) + b t with noise; `memory` of the noise from row to row, its variance stays 1.
std::vector<double> noisy(double memory, std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> white;
  std::vector<double> noise;
  double state = white(engine);
  for (int k = 0; k < kRows; ++k) {
    noise.push_back(state);
    state = memory * state + std::sqrt(1.0 - memory * memory) * white(engine);
  }
  return noise;
}

Fit fitted(const std::vector<double>& noise, bool with_blind = false) {
  const auto time = [](Eigen::Index k) { return static_cast<double>(k) / kRows; };
  const Residuals residuals{.values =
                                [&](const Eigen::VectorXd& z, Eigen::VectorXd& out) {
                                  out.resize(kRows);
                                  for (Eigen::Index k = 0; k < kRows; ++k)
                                    out(k) = std::exp(z(0) * time(k)) + z(1) * time(k) - std::exp(time(k)) -
                                             2.0 * time(k) + noise[static_cast<std::size_t>(k)];
                                  return true;
                                },
                            .derivatives =
                                [&](const Eigen::VectorXd& z, Eigen::MatrixXd& out) {
                                  out.setZero(kRows, z.size());
                                  for (Eigen::Index k = 0; k < kRows; ++k) {
                                    out(k, 0) = time(k) * std::exp(z(0) * time(k));
                                    out(k, 1) = time(k);
                                  }
                                  return true;
                                }};
  Eigen::VectorXd start = Eigen::VectorXd::Zero(with_blind ? 3 : 2);
  return gauss_newton(residuals, start, {.limit = 0.7});
}

/// The part of 200 noises whose 95 % interval holds a = 1.
double coverage(double memory) {
  int held = 0;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    const Fit fit = fitted(noisy(memory, seed));
    EXPECT_TRUE(fit.found);
    held += std::abs(fit.at(0) - 1.0) < 1.96 * std::sqrt(fit.covariance(0, 0)) ? 1 : 0;
  }
  return held / 200.0;
}

// The intervals hold in 90 to 99 % of white noises, and of noises that last for 20 rows, where the
// information alone would hold in a third. Catches: a covariance without the scatter of the scores, a factor
// in either.
TEST(GaussNewton, IntervalsHoldForWhiteAndForColouredResiduals) {
  if (kSanitized) GTEST_SKIP() << kStatistic;
  EXPECT_GT(coverage(0.0), 0.9);
  EXPECT_LT(coverage(0.0), 0.995);
  EXPECT_GT(coverage(0.95), 0.87);
}

// The scores of white residuals scatter by chance. Catches: intervals that this widens, by 7 % on the average
// here.
TEST(GaussNewton, ChanceWidensNoIntervals) {
  if (kSanitized) GTEST_SKIP() << kStatistic;
  double growth = 0.0;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    const Fit fit = fitted(noisy(0.0, seed));
    const Eigen::MatrixXd white = (fit.jacobian.transpose() * fit.jacobian).inverse();
    growth += std::sqrt(fit.covariance(0, 0) / white(0, 0)) / 200.0;
  }
  EXPECT_LT(growth, 1.03);
}

// A coordinate that the residuals do not have stays where it is and is unknown. Catches: a division by zero,
// a number from nothing.
TEST(GaussNewton, ADirectionThatNothingShowsIsUnknown) {
  const Fit fit = fitted(noisy(0.0, 1), true);
  ASSERT_TRUE(fit.found);
  EXPECT_EQ(fit.at(2), 0.0);
  EXPECT_NEAR(std::sqrt(fit.covariance(2, 2)), 100.0, 1.0);
  EXPECT_NEAR(fit.at(0), 1.0, 0.5);
}

// Coordinates that are known 100 times as well together as each of them: a valley along b = a^2, which bends
// so much that a whole step climbs its side. Catches: a damping that holds them by what each of them tells:
// steps become so short that the search ends at a = 0.34, 0.66 standard deviations from the bottom.
TEST(GaussNewton, ASearchEndsAtTheBottomOfAValley) {
  constexpr double kSide = 100.0;
  const Residuals residuals{.values =
                                [&](const Eigen::VectorXd& z, Eigen::VectorXd& out) {
                                  out.resize(2);
                                  out << kSide * (z(1) - z(0) * z(0)), z(0) - 1.0;
                                  return true;
                                },
                            .derivatives =
                                [&](const Eigen::VectorXd& z, Eigen::MatrixXd& out) {
                                  out.resize(2, 2);
                                  out << -2.0 * kSide * z(0), kSide, 1.0, 0.0;
                                  return true;
                                }};
  const Eigen::VectorXd start{{0.2, 0.04}};
  const Fit fit =
      gauss_newton(residuals, start, {.limit = 0.7, .most = 60, .valleys = true, .covariance = false});
  EXPECT_TRUE(fit.ended);
  EXPECT_NEAR(fit.at(0), 1.0, 0.01);
  EXPECT_NEAR(fit.at(1), 1.0, 0.02);
}

}  // namespace
}  // namespace drivebench::identification::gauss_newton_test
