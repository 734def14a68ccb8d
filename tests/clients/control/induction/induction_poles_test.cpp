#include "clients/control/induction/induction_poles.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/clients/control/induction/servo_motor.hpp"

namespace drivebench::control::induction_poles_test {
namespace {

constexpr double kTolerance = 0.002;  // case 2

/// The poles in rising order of their real parts, conjugate pairs with the upper one only.
std::vector<std::complex<double>> upper(std::vector<std::complex<double>> poles) {
  std::erase_if(poles, [](const auto& p) { return p.imag() < -1e-6 * std::abs(p); });
  std::ranges::sort(poles, {}, [](const auto& p) { return p.real(); });
  return poles;
}

void expect_poles(const std::vector<std::complex<double>>& found,
                  const std::vector<std::complex<double>>& expected) {
  const std::vector<std::complex<double>> poles = upper(found);
  ASSERT_EQ(poles.size(), expected.size());
  for (std::size_t i = 0; i < poles.size(); ++i) {
    EXPECT_NEAR(poles[i].real(), expected[i].real(), kTolerance * std::abs(expected[i].real()) + 0.005);
    EXPECT_NEAR(poles[i].imag(), expected[i].imag(), kTolerance * std::abs(expected[i].imag()) + 1e-6);
  }
}

// Case 2, gains of 8.2.2. Catches: a gain at the wrong power of s and a flux loop without M.
TEST(InductionPoles, OfFieldOrientedControl) {
  expect_poles(mechanical_poles(
                   {.integral_per_s3 = 1.07e6, .proportional_per_s2 = 7.04e5, .derivative_per_s = 1.07e3}),
               {{-534.24, 645.73}, {-1.52, 0.0}});
  expect_poles(
      flux_poles(kServoMotor.machine, {.proportional_a_per_wb = 1600.0, .integral_a_per_wbs = 23000.0}),
      {{-5479.75, 0.0}, {-13.68, 0.0}});
  expect_poles(current_poles(kServoMotor, {.proportional_v_per_a = 6.4, .integral_v_per_as = 740.0}),
               {{-2493.0, 0.0}, {-70.3, 0.0}});
}

// Case 2, gains of 8.2.5. Catches: the same where the flux loop is faster than 4 kHz can sample: z = 1 -
// 32830/4000 lies far outside the unit circle, which is what makes it limit-cycle.
TEST(InductionPoles, OfInputOutputLinearisation) {
  expect_poles(
      mechanical_poles({.integral_per_s3 = 3.0e5, .proportional_per_s2 = 5.5e4, .derivative_per_s = 125.0}),
      {{-59.74, 225.33}, {-5.52, 0.0}});
  const auto flux =
      flux_poles(kServoMotor.machine, {.proportional_a_per_wb = 1e4, .integral_a_per_wbs = 4.2e5});
  expect_poles(flux, {{-32829.7, 0.0}, {-41.70, 0.0}});
  EXPECT_LT(1.0 + upper(flux)[0].real() / 4000.0, -1.0);
  expect_poles(current_poles(kServoMotor, {.proportional_v_per_a = 15.0, .integral_v_per_as = 9000.0}),
               {{-4078.0, 0.0}, {-523.0, 0.0}});
}

}  // namespace
}  // namespace drivebench::control::induction_poles_test
