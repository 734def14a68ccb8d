#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "clients/control/salient/least_current.hpp"
#include "clients/control/salient/salient_pm_controller.hpp"

namespace drivebench::control::salient_pm_test {
namespace {

SalientPmModel machine_with(double inductance_d_h, double inductance_q_h) {
  return {.pole_pairs = 4.0,
          .resistance_ohm = 0.35,
          .inductance_d_h = inductance_d_h,
          .inductance_q_h = inductance_q_h,
          .torque_constant_nm_per_a = 0.30,
          .friction_nms = 2e-4,
          .inertia_kgm2 = 3e-4};
}
const SalientPmModel kBuried = machine_with(1.8e-3, 4.2e-3);
const SalientPmModel kInverse = machine_with(4.2e-3, 1.8e-3);
const SalientPmModel kRound = machine_with(3e-3, 3e-3);

/// The largest torque over all directions of a current of this length.
double searched_torque_nm(const SalientPmModel& m, double current_a) {
  double best_nm = 0.0;
  for (int k = 0; k <= 100000; ++k) {
    const double angle_rad = std::numbers::pi * k / 100000.0;
    best_nm =
        std::max(best_nm, m.torque_nm(current_a * std::cos(angle_rad), current_a * std::sin(angle_rad)));
  }
  return best_nm;
}

// ST-06. Catches: i_d of the wrong sign, a curve of another machine, a Newton that ends early: the current
// gives the torque to 1e-12, and no direction of as long a current gives more. The search's grid is 3e-5 rad,
// which at a maximum costs the square.
TEST(LeastCurrent, NoOtherDirectionOfTheSameCurrentGivesMoreTorque) {
  for (const SalientPmModel& m : {kBuried, kInverse, kRound}) {
    for (const double torque_nm : {1e-6, 0.1, 1.0, 6.0, 40.0}) {
      const Dq i = least_current(m, torque_nm).current_a;
      EXPECT_NEAR(m.torque_nm(i.d, i.q), torque_nm, 1e-12 * torque_nm);
      EXPECT_NEAR(searched_torque_nm(m, std::hypot(i.d, i.q)), torque_nm, 1e-8 * torque_nm);
      EXPECT_NEAR(most_torque_nm(m, std::hypot(i.d, i.q)), torque_nm, 1e-12 * torque_nm);
    }
  }
  EXPECT_LT(least_current(kBuried, 6.0).current_a.d, -5.0);
  EXPECT_GT(least_current(kInverse, 6.0).current_a.d, 5.0);
  EXPECT_EQ(least_current(kRound, 6.0).current_a.d, 0.0);
  EXPECT_NEAR(least_current(kRound, 6.0).current_a.q, 20.0, 1e-12);
}

// Catches: a braking torque whose direct current changes its sign, and slopes that are not those of the
// currents.
TEST(LeastCurrent, SlopesAreThoseOfTheCurrents) {
  constexpr double kStep_nm = 1e-5;
  for (const double torque_nm : {-6.0, -0.5, 0.5, 6.0}) {
    const LeastCurrent x = least_current(kBuried, torque_nm);
    const LeastCurrent above = least_current(kBuried, torque_nm + kStep_nm);
    const LeastCurrent below = least_current(kBuried, torque_nm - kStep_nm);
    EXPECT_NEAR(x.slope_a_per_nm.d, (above.current_a.d - below.current_a.d) / (2.0 * kStep_nm), 1e-7);
    EXPECT_NEAR(x.slope_a_per_nm.q, (above.current_a.q - below.current_a.q) / (2.0 * kStep_nm), 1e-7);
    EXPECT_LT(x.current_a.d, 0.0);
    EXPECT_EQ(std::signbit(x.current_a.q), std::signbit(torque_nm));
  }
  EXPECT_EQ(least_current(kBuried, 0.0).current_a.d, 0.0);
  EXPECT_EQ(least_current(kBuried, 0.0).current_a.q, 0.0);
}

// ST-06. Catches: the printed d-equation (its speed voltage has the wrong sign) and a decoupling without the
// saliency: voltages of the references, put into the machine's equations, give back the slopes of the
// currents, and power in is loss, stored energy and shaft.
TEST(SalientReferences, TheirVoltagesBalanceThePower) {
  const SalientPmParameters p = {.machine = kBuried,
                                 .sample_rate_hz = 10e3,
                                 .counts_per_revolution = 4096.0,
                                 .voltage_limit_v = 200.0,
                                 .current_limit_a = 20.0,
                                 .torque_pole_per_s = 2000.0,
                                 .position = ServoGains::placed(150.0, 150.0, 150.0),
                                 .speed_observer = {.angle_per_s = 3000.0, .speed_per_s2 = 2e6}};
  for (const double speed_rad_s : {-250.0, 0.0, 300.0}) {
    const Reference r = {
        .angle_rad = 0.0, .speed_rad_s = speed_rad_s, .acceleration_rad_s2 = 15e3, .jerk_rad_s3 = -1e6};
    const SalientReferences x = salient_references(p, r);
    const Dq u = salient_voltage_v(kBuried, x, speed_rad_s);
    const Dq i = x.least.current_a;
    const double i_d_a_s = x.torque_nm_per_s * x.least.slope_a_per_nm.d;
    const double i_q_a_s = x.torque_nm_per_s * x.least.slope_a_per_nm.q;
    const double stored_w = 1.8e-3 * i.d * i_d_a_s + 4.2e-3 * i.q * i_q_a_s;
    const double lost_w = 0.35 * (i.d * i.d + i.q * i.q);
    EXPECT_NEAR(u.d * i.d + u.q * i.q, lost_w + stored_w + x.torque_nm * speed_rad_s, 1e-9);
    EXPECT_NEAR(x.torque_nm, 3e-4 * 15e3 + 2e-4 * speed_rad_s, 1e-12);
  }
}

}  // namespace
}  // namespace drivebench::control::salient_pm_test
