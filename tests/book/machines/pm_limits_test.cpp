#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <optional>

#include "tests/book/book_bench.hpp"

namespace drivebench::pm_limits_test {
namespace {

constexpr double kVoltage_v = 124.75;  // sqrt(3/2) (2/pi) 160

PmMachineParameters bm500() {
  const BenchConfig config = load_config(std::string(DRIVEBENCH_CONFIGS) + "/benches/bm500.toml");
  return std::get<PmMachineParameters>(config.setup.axes[0].parameters.machine);
}

/// The machine turning steadily with its currents at rest in the frame of the rotor, at angle 0, where d is a
/// and q is b. Its own derivative() gives the voltages that this takes.
class SteadyPm {
 public:
  explicit SteadyPm(double speed_rad_s, PmMachineParameters p = bm500())
      : p_(p), c_(constants_of(p)), speed_(speed_rad_s) {}

  Dq voltage_v(Dq i) const {
    // i_ab' = n_p w J i_dq must hold; derivative() is linear in the voltage.
    const double omega = p_.pole_pairs * speed_;
    const PmMachineState at_zero = slope(i, {0.0, 0.0});
    return {.d = (-omega * i.q - at_zero.i_a_a) * p_.inductance_d_h,
            .q = (omega * i.d - at_zero.i_b_a) * p_.inductance_q_h};
  }
  double torque_nm(Dq i) const { return drivebench::torque_nm(c_, {.i_a_a = i.d, .i_b_a = i.q}, motion()); }
  /// The currents that a voltage drives: the inverse of voltage_v, which is affine.
  Dq current_a(Dq v) const {
    const Dq v0 = voltage_v({0.0, 0.0});
    const Dq vd = voltage_v({1.0, 0.0});
    const Dq vq = voltage_v({0.0, 1.0});
    const double a = vd.d - v0.d, b = vq.d - v0.d, c = vd.q - v0.q, d = vq.q - v0.q;
    const double x = v.d - v0.d, y = v.q - v0.q;
    const double det = a * d - b * c;
    return {.d = (d * x - b * y) / det, .q = (a * y - c * x) / det};
  }

 private:
  RotorMotion motion() const { return {0.0, speed_, {1.0, 0.0}}; }
  PmMachineState slope(Dq i, TwoPhase v) const {
    return derivative(c_, {.i_a_a = i.d, .i_b_a = i.q}, motion(), {.voltage_v = v});
  }

  PmMachineParameters p_;
  PmMachineConstants c_;
  double speed_;
};

struct Best {
  double torque_nm = 0.0;
  Dq current_a{};
};

/// The largest torque of the wanted sign within voltage and current limit, by a search along both limits.
Best best_torque(double speed_rad_s, double limit_a, double sign, bool voltage_only = false) {
  const SteadyPm machine(speed_rad_s);
  Best best;
  const auto take = [&](Dq i) {
    const double torque = machine.torque_nm(i);
    if (sign * torque > sign * best.torque_nm) best = {torque, i};
  };
  constexpr int kAngles = 20'000;
  for (int k = 0; k < kAngles; ++k) {
    const double angle = 2.0 * std::numbers::pi * k / kAngles;
    const Dq i{limit_a * std::cos(angle), limit_a * std::sin(angle)};
    const Dq v = machine.voltage_v(i);
    if (!voltage_only && std::hypot(v.d, v.q) <= kVoltage_v) take(i);
    const Dq at_limit = machine.current_a({kVoltage_v * std::cos(angle), kVoltage_v * std::sin(angle)});
    if (voltage_only || std::hypot(at_limit.d, at_limit.q) <= limit_a) take(at_limit);
  }
  return best;
}

/// The speed between two speeds at which a function rises through zero.
template <class F>
double crossing(double low, double high, F f) {
  const bool rises = f(high) > 0.0;
  for (int k = 0; k < 40; ++k) {
    const double middle = 0.5 * (low + high);
    ((f(middle) > 0.0) == rises ? high : low) = middle;
  }
  return 0.5 * (low + high);
}

/// From this speed on the current limit alone needs more than the voltage limit (i_d = 0, i_q = +-I).
double first_transition(double limit_a, double sign, const PmMachineParameters& p = bm500()) {
  return crossing(50.0, 900.0, [&](double w) {
    const Dq v = SteadyPm(w, p).voltage_v({0.0, sign * limit_a});
    return std::hypot(v.d, v.q) - kVoltage_v;
  });
}

/// From this speed on the best torque within the voltage limit needs less than the current limit.
double second_transition(double limit_a, double sign) {
  return crossing(250.0, 900.0, [&](double w) {
    const Dq i = best_torque(w, limit_a, sign, true).current_a;
    return limit_a - std::hypot(i.d, i.q);
  });
}

// Case 29, K_m = 0.162. 0.2 %; the search has a grid of 20 000 angles. Catches: an inductance or a speed
// voltage off by a factor, n_p in the wrong place.
TEST(BookPmLimits, TheTransitionSpeedsOfTheBm500AreThoseOfTheReference) {
  EXPECT_NEAR(first_transition(22.05, 1.0), 591.5, 1.2);
  EXPECT_NEAR(first_transition(22.05, -1.0), 634.5, 1.3);
  EXPECT_NEAR(first_transition(67.36, 1.0), 285.3, 0.6);
  EXPECT_NEAR(first_transition(67.36, -1.0), 317.7, 0.7);
  EXPECT_NEAR(second_transition(67.36, 1.0), 340.8, 0.7);
  EXPECT_NEAR(second_transition(67.36, -1.0), 383.4, 0.8);
  // With the K_m that the book lists, which differs from that of its results.
  PmMachineParameters listed = bm500();
  listed.torque_constant_nm_per_a = 0.243;
  EXPECT_NEAR(first_transition(22.05, 1.0, listed), 440.0, 0.9);
  EXPECT_NEAR(first_transition(22.05, -1.0, listed), 476.0, 1.0);
}

// Case 30. 0.2 %. Catches: a torque that does not agree with the voltages that it takes.
TEST(BookPmLimits, TheLargestTorquesOfTheBm500AreThoseOfTheReference) {
  struct Case {
    double limit_a, speed_rad_s, motoring_nm, braking_nm;
  };
  for (const Case& c : {Case{22.0, 800.0, 3.130, -3.300}, Case{22.0, 1000.0, 2.610, -2.816},
                        Case{67.4, 400.0, 8.453, -9.487}}) {
    EXPECT_NEAR(best_torque(c.speed_rad_s, c.limit_a, 1.0).torque_nm, c.motoring_nm, 2e-3 * c.motoring_nm);
    EXPECT_NEAR(best_torque(c.speed_rad_s, c.limit_a, -1.0).torque_nm, c.braking_nm, -2e-3 * c.braking_nm);
  }
}

}  // namespace
}  // namespace drivebench::pm_limits_test
