#include "clients/identification/math/filters.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <random>
#include <vector>

namespace drivebench::identification::filters_test {
namespace {

constexpr double kPi = std::numbers::pi;

std::vector<double> product(const std::vector<double>& x, const std::vector<double>& y) {
  std::vector<double> z(x.size() + y.size() - 1, 0.0);
  for (std::size_t i = 0; i < x.size(); ++i) {
    for (std::size_t j = 0; j < y.size(); ++j)
      z[i + j] += x[i] * y[j];
  }
  return z;
}

/// The sections of the low-pass multiplied, as the book states its coefficients.
AnalogFilter butterworth(int order, double cutoff_rad_s) {
  AnalogFilter whole = {.numerator = {1.0}, .denominator = {1.0}};
  for (const AnalogFilter& section : butterworth_sections(order, cutoff_rad_s)) {
    whole.numerator = product(whole.numerator, section.numerator);
    whole.denominator = product(whole.denominator, section.denominator);
  }
  return whole;
}

/// y_k = b_0 u_k + b_1 u_(k-1) + ... - a_1 y_(k-1) - ..., as the book writes it: (2.52).
std::vector<double> difference_equation(const DigitalFilter& f, const std::vector<double>& u) {
  std::vector<double> y(u.size(), 0.0);
  for (std::size_t k = 0; k < u.size(); ++k) {
    for (std::size_t i = 0; i < f.b.size() && i <= k; ++i)
      y[k] += f.b[i] * u[k - i];
    for (std::size_t i = 1; i < f.a.size() && i <= k; ++i)
      y[k] -= f.a[i] * y[k - i];
  }
  return y;
}

std::complex<double> response(const AnalogFilter& f, double rad_s) {
  const std::complex<double> s(0.0, rad_s);
  std::complex<double> top = 0.0;
  std::complex<double> bottom = 0.0;
  for (const double x : f.numerator)
    top = top * s + x;
  for (const double x : f.denominator)
    bottom = bottom * s + x;
  return top / bottom;
}

std::complex<double> response(const DigitalFilter& f, double rad_s, double period_s) {
  const std::complex<double> q = std::polar(1.0, -rad_s * period_s);
  std::complex<double> top = 0.0;
  std::complex<double> bottom = 0.0;
  for (std::size_t i = f.b.size(); i-- > 0;)
    top = top * q + f.b[i];
  for (std::size_t i = f.a.size(); i-- > 0;)
    bottom = bottom * q + f.a[i];
  return top / bottom;
}

// FLT-01: |G|^2 = 1/(1 + (w/w_c)^2n) at 0.6 and 2 w_c for every order, to rounding; the book's values to
// their four digits. Catches: poles of the right half plane, an odd order without its real pole.
TEST(Filters, TheButterworthLowPassHasItsGainForAnyOrder) {
  for (int order = 1; order <= 12; ++order) {
    const AnalogFilter f = butterworth(order, 100.0);
    for (const double ratio : {0.6, 1.0, 2.0}) {
      const double expected = 1.0 / std::sqrt(1.0 + std::pow(ratio, 2 * order));
      EXPECT_NEAR(std::abs(response(f, 100.0 * ratio)), expected, 1e-12) << order;
    }
    for (const std::complex<double>& pole : butterworth_poles(order))
      EXPECT_LT(pole.real(), 0.0);
  }
  EXPECT_NEAR(std::abs(response(butterworth(3, 1.0), 0.6)), 0.9775, 5e-5);
  EXPECT_NEAR(std::abs(response(butterworth(4, 1.0), 2.0)), 0.0624, 5e-5);
}

// AC-17: order 3, 100 Hz at 5 kHz; 1e-5 of the coefficients, b_0 to its six digits. Catches: prewarping where
// none is asked for and the other way round, a denominator that is not normalised.
TEST(Filters, TheBilinearFilterHasTheBooksCoefficients) {
  const AnalogFilter f = butterworth(3, 2.0 * kPi * 100.0);
  const DigitalFilter plain = bilinear(f, 2e-4);
  const double expected[] = {1.0, -2.74916512, 2.52881103, -0.7778957};
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_NEAR(plain.a[i], expected[i], 1e-5 * std::abs(expected[i])) << i;
  EXPECT_NEAR(plain.b[0], 2.18777e-4, 1e-5 * 2.18777e-4);
  EXPECT_NEAR(plain.b[1], 3.0 * plain.b[0], 1e-15);
  const DigitalFilter warped = bilinear(f, 2e-4, 2.0 * kPi * 100.0);
  const double butter[] = {1.0, -2.74883581, 2.52823122, -0.77763856};
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_NEAR(warped.a[i], butter[i], 1e-6) << i;
  EXPECT_NEAR(std::abs(response(warped, 2.0 * kPi * 100.0, 2e-4)), std::sqrt(0.5), 1e-9);
  EXPECT_NEAR(std::abs(response(plain, 2.0 * kPi * 99.869, 2e-4)), std::sqrt(0.5), 1e-5);
}

// FLT-03: both realisations of the same filter give the same output to 1e-12 of it. Catches: a row of the
// companion matrix in the wrong order, an output vector without its -b_0 a_i.
TEST(Filters, StateSpaceAndDifferenceEquationAgree) {
  const DigitalFilter filter = bilinear(butterworth(3, 2.0 * kPi * 100.0), 2e-4);
  StateSpaceFilter states(filter);
  std::mt19937 engine(7);
  std::uniform_real_distribution<double> input(-1.0, 1.0);
  std::vector<double> u(2000);
  std::generate(u.begin(), u.end(), [&] { return input(engine); });
  const std::vector<double> direct = difference_equation(filter, u);
  for (std::size_t k = 0; k < u.size(); ++k)
    ASSERT_NEAR(states.step(u[k]), direct[k], 1e-12);
}

// FLT-04: in the middle the gain is |G|^2 and the phase nothing, at the corner half the amplitude; 1e-4 is
// what is left of the ends. A constant and a ramp pass unchanged up to the ends. Catches: one pass only,
// passes that start from rest.
TEST(Filters, TheZeroPhaseFilterHasNoPhaseAndHalfTheAmplitudeAtItsCorner) {
  constexpr double kPeriod = 1e-3;
  Series sine(4000);
  Series ramp(4000);
  for (std::size_t k = 0; k < sine.size(); ++k) {
    sine[k] = std::sin(2.0 * kPi * 20.0 * kPeriod * static_cast<double>(k));
    ramp[k] = 3.0 + 0.01 * static_cast<double>(k);
  }
  const Series y = zero_phase(sine, {.order = 2, .cutoff_hz = 20.0}, kPeriod);
  for (std::size_t k = 1500; k < 2500; ++k)
    ASSERT_NEAR(y[k], 0.5 * sine[k], 1e-4);
  const Series straight = zero_phase(ramp, {.order = 4, .cutoff_hz = 50.0}, kPeriod);
  for (std::size_t k = 0; k < ramp.size(); ++k)
    ASSERT_NEAR(straight[k], ramp[k], 1e-3) << k;  // of 40, by odd reflection and a settled start
}

// A tenth-order filter far below the sampling rate: the sections hold it to 1e-6. Catches: one polynomial for
// the whole, whose coefficients cancel to nothing.
TEST(Filters, AHighOrderFarBelowTheSamplingRateStaysAccurate) {
  Series one(20000, 1.0);
  for (const double x : zero_phase(one, {.order = 10, .cutoff_hz = 10.0}, 2e-5))
    ASSERT_NEAR(x, 1.0, 1e-6);
}

// Catches: a filter above the Nyquist frequency that is silently something else.
TEST(Filters, ACornerAboveHalfTheSamplingRateIsRefused) {
  const Series x(100, 1.0);
  EXPECT_THROW(zero_phase(x, {.order = 3, .cutoff_hz = 500.0}, 1e-3), IdentificationError);
  EXPECT_THROW(zero_phase(x, {.order = 0, .cutoff_hz = 50.0}, 1e-3), IdentificationError);
  EXPECT_THROW(zero_phase(x, {.order = 3, .cutoff_hz = -1.0}, 1e-3), IdentificationError);
}

}  // namespace
}  // namespace drivebench::identification::filters_test
