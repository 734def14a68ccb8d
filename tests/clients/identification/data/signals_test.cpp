#include "clients/identification/data/signals.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace drivebench::identification::signals_test {
namespace {

Series sine(double rad_per_sample, double phase_rad, std::size_t count = 400) {
  Series x(count);
  for (std::size_t k = 0; k < count; ++k)
    x[k] = std::sin(rad_per_sample * static_cast<double>(k) + phase_rad);
  return x;
}

// A central difference is the derivative at its sample, a backward one half a period before: errors a^2/6 and
// a^2/24 of a sine of a radians per sample. Catches: a difference that is taken to belong to another instant.
TEST(Signals, DifferencesBelongToTheirInstants) {
  constexpr double kStep = 0.05;
  const Series x = sine(kStep, 0.3);
  const Series central = central_difference(x, 1.0);
  const Series backward = backward_difference(x, 1.0);
  const Series second = second_difference(x, 1.0);
  for (std::size_t k = 1; k + 1 < x.size(); ++k) {
    const double at = kStep * static_cast<double>(k) + 0.3;
    ASSERT_NEAR(central[k], kStep * std::cos(at), kStep * kStep * kStep / 6.0);
    ASSERT_NEAR(backward[k], kStep * std::cos(at - 0.5 * kStep), kStep * kStep * kStep / 24.0);
    ASSERT_NEAR(second[k], -kStep * kStep * std::sin(at), std::pow(kStep, 4) / 12.0);
  }
  EXPECT_THROW(central_difference(Series{1.0, 2.0}, 1.0), IdentificationError);
}

// The ends of a parabola's derivative are exact. Catches: ends copied from their neighbours.
TEST(Signals, TheEndsOfACentralDifferenceAreOfSecondOrder) {
  Series x;
  for (int k = 0; k < 6; ++k)
    x.push_back(1.0 + 2.0 * k + 0.5 * k * k);
  const Series slope = central_difference(x, 1.0);
  EXPECT_NEAR(slope.front(), 2.0, 1e-12);
  EXPECT_NEAR(slope.back(), 7.0, 1e-12);
}

// A cubic is interpolated exactly, later for positive shifts and earlier for negative ones. Catches: a shift
// the wrong way, its fraction counted from the wrong sample.
TEST(Signals, AShiftByPartsOfASampleIsExactForACubic) {
  const auto cubic = [](double t) { return 1.0 - 0.3 * t + 0.02 * t * t - 1e-3 * t * t * t; };
  Series x;
  for (int k = 0; k < 40; ++k)
    x.push_back(cubic(k));
  for (const double shift : {0.5, -1.6, -2.1, 3.0}) {
    const Series y = advanced(x, shift);
    for (std::size_t k = 8; k < 32; ++k)
      ASSERT_NEAR(y[k], cubic(static_cast<double>(k) + shift), 1e-11) << shift;
  }
}

// The book's vector of P3-01, and a frame that turns with the field sees constants. Catches: the transform
// with factor 2/3, a frame that turns backwards.
TEST(Signals, ThreePhasesAndTurningFrames) {
  const TwoPhaseSeries book = two_phase(Series{3.0}, Series{-1.0}, Series{-2.0});
  EXPECT_NEAR(book.a[0], 3.674235, 1e-6);
  EXPECT_NEAR(book.b[0], 0.707107, 1e-6);
  Series angle(100);
  for (std::size_t k = 0; k < angle.size(); ++k)
    angle[k] = 0.1 * static_cast<double>(k);
  const TwoPhaseSeries field = {.a = sine(0.1, std::numbers::pi / 2.0, 100), .b = sine(0.1, 0.0, 100)};
  const TwoPhaseSeries seen = rotated(field, angle);
  for (std::size_t k = 0; k < angle.size(); ++k) {
    ASSERT_NEAR(seen.a[k], 1.0, 1e-12);
    ASSERT_NEAR(seen.b[k], 0.0, 1e-12);
  }
}

// Catches: radians per count with the wrong resolution, the half count in the wrong direction.
TEST(Signals, CountsBecomeAngles) {
  const Series angle = angle_of(Series{0.0, 500.0, -1000.0}, 2000.0, true);
  EXPECT_NEAR(angle[0], std::numbers::pi / 2000.0, 1e-12);
  EXPECT_NEAR(angle[1], std::numbers::pi / 2.0 + std::numbers::pi / 2000.0, 1e-12);
  EXPECT_NEAR(angle_of(Series{-1000.0}, 2000.0, false)[0], -std::numbers::pi, 1e-12);
}

}  // namespace
}  // namespace drivebench::identification::signals_test
