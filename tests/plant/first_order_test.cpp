#include "plant/math/first_order.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace drivebench::first_order_test {
namespace {

long double wide(double x) {
  return static_cast<long double>(x);
}

/// 1 - (1 - exp(-a))/a in extended precision, by its series where the difference cancels.
long double exact_ramp(double a) {
  if (a > 0.5) return 1.0L + std::expm1(-wide(a)) / wide(a);
  long double term = 1.0L;
  long double sum = 0.0L;
  for (int k = 1; k < 40; ++k) {
    term *= -wide(a) / (k + 1);
    sum -= term;
  }
  return sum;
}

// From 1e-12 to 1e3, through the seam of the two formulas at 1/16. There 1 - exp(-a) has lost 1/0.06 of its
// digits, and 1 - change/a another 1/0.03 of what is left: 2e-15 and 6e-14. Catches: a wrong term of the
// series, cancellation for small steps, a seam.
TEST(FirstOrder, TheCoefficientsAreThoseOfTheExponential) {
  double worst_change = 0.0;
  double worst_ramp = 0.0;
  for (double a = 1e-12; a < 1e3; a *= 1.037) {
    const FirstOrderStep step = first_order_step(a);
    const long double change = -std::expm1(-wide(a));
    worst_change = std::max(worst_change, static_cast<double>(std::abs(wide(step.change) / change - 1.0L)));
    worst_ramp = std::max(worst_ramp, static_cast<double>(std::abs(wide(step.ramp) / exact_ramp(a) - 1.0L)));
  }
  EXPECT_LT(worst_change, 2e-15);
  EXPECT_LT(worst_ramp, 6e-14);
}

// Catches: a division by zero, a settled lag that drifts.
TEST(FirstOrder, NoTimeAndNoDifferenceChangeNothing) {
  EXPECT_EQ(lagged(first_order_step(0.0), 3.7, -1.0, 12.0), 3.7);
  EXPECT_EQ(first_order_step(1e300).change, 1.0);
  double y = 0.3;
  for (int n = 0; n < 1000; ++n)
    y = lagged(first_order_step(0.01 * n), y, 0.3, 0.3);
  EXPECT_EQ(y, 0.3);
}

// T y' = x - y behind a ramp x = s t from rest: y = s (t - T (1 - exp(-t/T))). In steps of any length, to
// rounding. Catches: an input that counts at its start, its end or its middle only.
TEST(FirstOrder, ARampFollowsTheEquation) {
  constexpr double kTimeConstant_s = 0.02;
  constexpr double kSlope = 7.0;
  double y = 0.0;
  double t = 0.0;
  for (int n = 0; n < 400; ++n) {
    const double step_s = 1e-5 * (1 + n % 37);
    const double from = kSlope * t;
    t += step_s;
    y = lagged(first_order_step(step_s / kTimeConstant_s), y, from, kSlope * t);
    ASSERT_NEAR(y, kSlope * (t + kTimeConstant_s * std::expm1(-t / kTimeConstant_s)), 1e-14);
  }
}

}  // namespace
}  // namespace drivebench::first_order_test
