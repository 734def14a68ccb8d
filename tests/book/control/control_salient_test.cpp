// The salient PM machine under its linearised torque, on the product's own bench (ST-06). The reference has
// equations and no numbers: the tests check closed forms.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>

#include "clients/control/salient/least_current.hpp"
#include "tests/book/closed_loop.hpp"

namespace drivebench::control_salient_test {
namespace {

constexpr SalientPmModel kIpm = {.pole_pairs = 4.0,
                                 .resistance_ohm = 0.35,
                                 .inductance_d_h = 1.8e-3,
                                 .inductance_q_h = 4.2e-3,
                                 .torque_constant_nm_per_a = 0.30,
                                 .friction_nms = 2e-4,
                                 .inertia_kgm2 = 3e-4,
                                 .star = true};

/// Copper losses of the whole run over those of its resistance, ∫|i|² dt [A²s].
double current_square(const Outcome& seen) {
  const std::size_t d = seen.column("i_d_a");
  const std::size_t q = seen.column("i_q_a");
  double sum = 0.0;
  for (const ClosedLoopRow& row : seen.rows)
    sum += row.telemetry[d] * row.telemetry[d] + row.telemetry[q] * row.telemetry[q];
  return 1e-4 * sum;
}

/// The same of the currents that the reference needs, by least_current() or with i_d = 0.
double expected_square(const Outcome& seen, bool least) {
  double sum = 0.0;
  for (const ClosedLoopRow& row : seen.rows) {
    const double torque_nm =
        kIpm.inertia_kgm2 * row.reference.acceleration_rad_s2 + kIpm.friction_nms * row.reference.speed_rad_s;
    const Dq i = least ? control::least_current(kIpm, torque_nm).current_a
                       : Dq{.d = 0.0, .q = torque_nm / kIpm.torque_constant_nm_per_a};
    sum += i.d * i.d + i.q * i.q;
  }
  return 1e-4 * sum;
}

// Catches: torque without the saliency, a decoupling with the printed d-equation, a magnet angle of another
// pole pair number, a current curve that is not used: the move is followed with the least copper loss for its
// torque, and with i_d = 0 it costs a fifth more.
TEST(SalientControl, TheMoveTakesTheLeastCurrentForItsTorque) {
  const Outcome least = closed_loop("book/9.11");
  EXPECT_LE(least.peak_error_counts, 10.0);
  EXPECT_LE(least.final_encoder_error_counts, 1.0 + 1e-9);
  EXPECT_EQ(least.saturated_samples, 0);
  EXPECT_NEAR(current_square(least), expected_square(least, true), 0.02 * expected_square(least, true));
  const Outcome quadrature = closed_loop("book/9.11-quadrature");
  EXPECT_LE(quadrature.peak_error_counts, 10.0);
  EXPECT_LT(quadrature.peak_of("i_d_a"), 1.0);
  EXPECT_NEAR(current_square(quadrature) / current_square(least),
              expected_square(quadrature, false) / expected_square(least, true), 0.03);
}

/// The part of the error that turns with the detent torque, 16 times a turn, while the speed is constant.
std::complex<double> detent_ripple_rad(const Outcome& seen) {
  std::complex<double> sum;
  int samples = 0;
  for (const ClosedLoopRow& row : seen.rows) {
    if (row.time_s < 0.3 || row.time_s >= 0.3 + 25.0 * 2.0 * 3.14159265358979 / (16.0 * 5.0265482)) continue;
    sum += row.error_rad * std::polar(1.0, -16.0 * row.reference.angle_rad);
    ++samples;
  }
  return 2.0 / samples * sum;
}

// Catches: a detent torque that does not reach the loop, or a loop whose gains are not those of its table.
// T_d/J at s = j·16·ω meets (1 + K2·H)·s/(s + r)³, with H = (s + l1)/(s + p)² what the speed observer, which
// knows nothing of it, adds. 10 %: the torque's pole at 2000 1/s, and half a count.
TEST(SalientControl, TheDetentTorqueLeavesTheErrorOfTheGains) {
  const Outcome seen = closed_loop("book/9.11-detent");
  const std::complex<double> s(0.0, 16.0 * 4.0 * 3.14159265358979 / 2.5);
  const std::complex<double> observer = (s + 3000.0) / ((s + 1500.0) * (s + 1500.0));
  const double expected_rad = 0.05 / 3e-4 * std::abs((1.0 + 450.0 * observer) * s / std::pow(s + 150.0, 3));
  EXPECT_NEAR(std::abs(detent_ripple_rad(seen)), expected_rad, 0.1 * expected_rad);
  const Outcome smooth = closed_loop("book/9.11-detent", {.parameters = {{"machine.detent_torque_nm", 0.0}}});
  EXPECT_LT(std::abs(detent_ripple_rad(smooth)), 0.1 * expected_rad);
}

}  // namespace
}  // namespace drivebench::control_salient_test
