// The phases of the brushless machine together: star, neutral, open phases, and the motor of BL-05 on a
// drive.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <random>

#include "plant/math/rk4.hpp"
#include "tests/plant/bldc_motor.hpp"

namespace drivebench::bldc_phases_test {
namespace {

using namespace bldc_motor;

/// BL-01 as printed, with the full inductance matrix, E31 and E32 corrected; `neutral` removes v_N.
Phases book_slopes(const BldcMachineParameters& p, const Phases& i, double angle_rad, double speed_rad_s,
                   const Phases& u, bool neutral) {
  Phases v{};
  for (std::size_t k = 0; k < 3; ++k) {
    v[k] = u[k] - p.stator_resistance_ohm * i[k] +
           p.torque_constant_nm_per_a * speed_rad_s *
               book_shape(p.pole_pairs * angle_rad - static_cast<double>(k) * 2.0 * kPi / 3.0);
  }
  // A star adds -v_N to each phase such that the currents keep their sum.
  const double v_n = neutral ? (sum(v) + p.stator_resistance_ohm * sum(i)) / 3.0 : 0.0;
  for (double& x : v)
    x -= v_n;
  const double l = p.self_inductance_h;
  const double m = p.mutual_inductance_h;
  const double scale = 1.0 / ((l - 2.0 * m) * (l + m));
  return {scale * ((l - m) * v[0] + m * v[1] + m * v[2]), scale * (m * v[0] + (l - m) * v[1] + m * v[2]),
          scale * (m * v[0] + m * v[1] + (l - m) * v[2])};
}

// BL-08: 14 V between phases a and b, c open, locked at 60 degrees. Catches: a wrong inductance or resistance
// along a line, a torque without sqrt(2/3).
TEST(BldcPhases, LockedWithTwoPhasesInSeriesTheCurrentRisesToTheValueOfTheReference) {
  const BldcMachineConstants c = constants_of(kMotor);
  const TerminalInput u{.voltage_v = three_to_two({7.0, -7.0, 0.0}),
                        .conduction = Conduction::kLine,
                        .line = {.a = 0.5 * std::sqrt(3.0), .b = -0.5}};
  constexpr double kTau_s = 4.1e-3;
  constexpr double kStep_s = 1e-5;
  BldcMachineState x;
  for (int n = 1; n <= 8200; ++n) {
    x = rk4_step(x, kStep_s, [&](const BldcMachineState& s) noexcept -> BldcMachineState {
      return derivative(c, s, motion(60.0 * kDegree), u);
    });
    // The local error of RK4, (h/tau)^5/120, is 7e-16 of the current.
    const Phases i = phases_of(x);
    ASSERT_NEAR(i[0], 10.0 * (1.0 - std::exp(-n * kStep_s / kTau_s)), 1e-9);
    ASSERT_NEAR(i[1], -i[0], 1e-12);
    ASSERT_NEAR(i[2], 0.0, 1e-12);
  }
  EXPECT_NEAR(torque_nm(c, x, motion(60.0 * kDegree)), -10.256, 1e-7);
  EXPECT_NEAR(losses_w(c, x, motion(0.0)), 140.0, 1e-5);
}

struct Turning {
  BldcMachineState machine;
  double angle_rad;
  double speed_rad_s;
};
struct BookTurning {
  ThreePhase current_a;
  double angle_rad;
};

// E32. The three currents of the book's model with its full inductance matrix beside the product, at varying
// speed and an unbalanced voltage with a common part. Catches: a neutral that is not removed from a star, a
// zero sequence that is lost or has the wrong inductance in independent phases.
TEST(BldcPhases, StarAndIndependentPhasesFollowTheBooksModelWithAndWithoutTheNeutralVoltage) {
  for (const bool star : {true, false}) {
    BldcMachineParameters p = kMotor;
    p.star = star;
    p.pole_pairs = 2;
    const BldcMachineConstants c = constants_of(p);
    constexpr double kStep_s = 1e-5;
    double speed_rad_s = 20.0;
    Turning x{.machine = {}, .angle_rad = 0.4, .speed_rad_s = 0.0};
    BookTurning book{.current_a = {0.0, 0.0, 0.0}, .angle_rad = 0.4};
    double largest_sum_a = 0.0;
    for (int n = 0; n < 10'000; ++n) {
      const double t = n * kStep_s;
      const Phases u{30.0 * std::cos(60.0 * t) + 5.0, 24.0 * std::cos(60.0 * t - 2.1),
                     30.0 * std::cos(60.0 * t + 2.1)};
      const TerminalInput input = input_of(u);
      x = rk4_step(x, kStep_s, [&](const Turning& s) noexcept -> Turning {
        return {derivative(c, s.machine, motion(s.angle_rad, speed_rad_s), input), speed_rad_s, 0.0};
      });
      book = rk4_step(book, kStep_s, [&](const BookTurning& s) noexcept -> BookTurning {
        const Phases slope =
            book_slopes(p, {s.current_a.a, s.current_a.b, s.current_a.c}, s.angle_rad, speed_rad_s, u, star);
        return {{slope[0], slope[1], slope[2]}, speed_rad_s};
      });
      const Phases i = phases_of(x.machine);
      ASSERT_NEAR(i[0], book.current_a.a, 1e-9) << t;
      ASSERT_NEAR(i[1], book.current_a.b, 1e-9) << t;
      ASSERT_NEAR(i[2], book.current_a.c, 1e-9) << t;
      largest_sum_a = std::max(largest_sum_a, std::abs(sum(i)));
      speed_rad_s += 0.01;
    }
    if (star) {
      EXPECT_LT(largest_sum_a, 1e-12);
    } else {
      EXPECT_GT(largest_sum_a, 5.0);
    }
  }
}

// BL-02: the neutral of a star ripples by e_p w/3, a triangle with three periods per electrical turn.
// Catches: a neutral taken as the mean of the terminals, the wrong sign of the ripple.
TEST(BldcPhases, TheNeutralRipplesByAThirdOfTheEmf) {
  const BldcMachineConstants c = constants_of(kMotor);
  double highest_v = -1e9;
  double lowest_v = 1e9;
  for (int n = 0; n < 3600; ++n) {
    const double angle_rad = 0.1 * n * kDegree;
    const double v = neutral_voltage_v(c, {}, motion(angle_rad, 100.0), 5.0);
    highest_v = std::max(highest_v, v);
    lowest_v = std::min(lowest_v, v);
    const double e = book_shape(angle_rad) + book_shape(angle_rad - 2.0 * kPi / 3.0) +
                     book_shape(angle_rad + 2.0 * kPi / 3.0);
    ASSERT_NEAR(v, 5.0 + 51.28 * e / 3.0, 1e-9);
    ASSERT_NEAR(v, neutral_voltage_v(c, {}, motion(angle_rad + 2.0 * kPi / 3.0, 100.0), 5.0), 1e-9);
  }
  EXPECT_NEAR(highest_v, 5.0 + 51.28 / 3.0, 1e-9);
  EXPECT_NEAR(lowest_v, 5.0 - 51.28 / 3.0, 1e-9);
}

// The neutral is what makes each winding obey its own equation: L_S i' - M(...) = u - v_N - R i + e_p w e.
// Catches: a neutral voltage that does not belong to the currents of the star.
TEST(BldcPhases, TheNeutralVoltageClosesTheEquationOfEveryPhaseOfAStar) {
  const BldcMachineConstants c = constants_of(kMotor);
  Random random{std::mt19937_64(22)};
  for (int n = 0; n < 1000; ++n) {
    const double angle_rad = random(4.0);
    const double speed_rad_s = random(500.0);
    const Phases u = random.three(200.0);
    const BldcMachineState x = without_neutral_current(state_of(random.three(20.0)));
    const RotorMotion now = motion(angle_rad, speed_rad_s);
    const Phases i = phases_of(x);
    const Phases slope = phases_of(derivative(c, x, now, input_of(u)));
    const double v_n = neutral_voltage_v(c, x, now, sum(u) / 3.0);
    for (std::size_t k = 0; k < 3; ++k) {
      const double e = book_shape(angle_rad - static_cast<double>(k) * 2.0 * kPi / 3.0);
      ASSERT_NEAR(2.87e-3 * slope[k], u[k] - v_n - 0.7 * i[k] + 0.5128 * speed_rad_s * e, 1e-9);
    }
  }
}

// Catches: a zero sequence that appears in a star, phases that conduct though they are open, a wrong coupling
// of the phases that are left: open windings are the constraint i' = 0, here solved with the full matrix.
TEST(BldcPhases, OpenPhasesCarryNothingAndTheOthersObeyTheirEquations) {
  const BldcMachineParameters p = independent();
  const BldcMachineConstants c = constants_of(p);
  Random random{std::mt19937_64(23)};
  for (unsigned set = 0; set < 8; ++set) {
    const RotorMotion now = motion(random(4.0), 300.0);
    const Phases u = random.three(100.0);
    TerminalInput input = input_of(u);
    const Phases conducts{(set & 1) != 0 ? 0.0 : 1.0, (set & 2) != 0 ? 0.0 : 1.0, (set & 4) != 0 ? 0.0 : 1.0};
    input.conducts = {conducts[0], conducts[1], conducts[2]};
    const BldcMachineState before = state_of(random.three(10.0));
    const BldcMachineState x = restricted(c, before, now, input);
    const Phases i = phases_of(x);
    const Phases slope = phases_of(derivative(c, x, now, input));
    for (std::size_t k = 0; k < 3; ++k) {
      if (conducts[k] == 0.0) {
        EXPECT_NEAR(i[k], 0.0, 1e-14);
        EXPECT_NEAR(slope[k], 0.0, 1e-10);  // of slopes of 1e5 A/s
        continue;
      }
      EXPECT_NEAR(i[k], phases_of(before)[k], 1e-13);
      const double e = book_shape(now.angle_rad - static_cast<double>(k) * 2.0 * kPi / 3.0);
      const double flux_slope_v = 2.72e-3 * slope[k] - 0.15e-3 * (sum(slope) - slope[k]);
      EXPECT_NEAR(flux_slope_v, u[k] - 0.7 * i[k] + 0.5128 * 300.0 * e, 1e-10) << set << " " << k;
    }
  }
}

// Catches: an open-circuit voltage of the wrong sign, a star whose current flows across its line or when
// open.
TEST(BldcPhases, OpenCircuitVoltagesHoldTheCurrentsAtZeroAndAStarObeysItsConduction) {
  const RotorMotion now = motion(0.6, 300.0);
  const BldcMachineConstants c = constants_of(independent());
  const WindingValues open_v = open_circuit_voltages(c, {}, now);
  const BldcMachineState slope = derivative(c, {}, now, {.voltage_v = open_v.stator, .zero_v = open_v.zero});
  EXPECT_NEAR(slope.i_a_a, 0.0, 1e-9);
  EXPECT_NEAR(slope.i_b_a, 0.0, 1e-9);
  EXPECT_NEAR(slope.i_zero_a, 0.0, 1e-9);
  EXPECT_NE(open_v.zero, 0.0);

  const BldcMachineConstants star = constants_of(kMotor);
  EXPECT_EQ(open_circuit_voltages(star, {}, now).zero, 0.0);
  TerminalInput u{
      .voltage_v = {50.0, 20.0}, .zero_v = 30.0, .conduction = Conduction::kNone, .line = {0.0, 1.0}};
  const BldcMachineState none = derivative(star, {}, now, u);
  EXPECT_EQ(none.i_a_a, 0.0);
  EXPECT_EQ(none.i_b_a, 0.0);
  EXPECT_EQ(none.i_zero_a, 0.0);
  u.conduction = Conduction::kLine;
  EXPECT_EQ(phases_of(derivative(star, {}, now, u))[0], 0.0);
  EXPECT_NE(derivative(star, {}, now, u).i_b_a, 0.0);
  EXPECT_EQ(restricted(star, {.i_a_a = 3.0, .i_b_a = 4.0}, now, u).i_a_a, 0.0);
  EXPECT_EQ(restricted(star, {.i_a_a = 3.0, .i_b_a = 4.0}, now, u).i_b_a, 4.0);
}

struct DriveRun {
  double mean_rad_s = 0.0;
  double lowest_rad_s = 1e9;
  double highest_rad_s = -1e9;
  double peak_a = 0.0;
  double late_peak_a = 0.0;
};

/// BL-05: the open-loop trapezoidal drive from rest, 10 Hz, over 3 s; speeds of the last second.
DriveRun trapezoidal_drive(double voltage_v) {
  const BldcMachineConstants c = constants_of(kMotor);
  constexpr double kStep_s = 1e-5;
  constexpr int kSteps = 300'000;
  constexpr double kDrive_rad_s = 2.0 * kPi * 10.0;
  Turning x{};
  DriveRun run;
  for (int n = 0; n < kSteps; ++n) {
    const double phase = kDrive_rad_s * kStep_s * (n + 0.5);
    Phases u{};
    for (std::size_t k = 0; k < 3; ++k)
      u[k] = -voltage_v * book_shape(phase - static_cast<double>(k) * 2.0 * kPi / 3.0);
    const TerminalInput input = input_of(u);
    x = rk4_step(x, kStep_s, [&](const Turning& s) noexcept -> Turning {
      const RotorMotion now = motion(s.angle_rad, s.speed_rad_s);
      return {derivative(c, s.machine, now, input), s.speed_rad_s,
              (torque_nm(c, s.machine, now) - kFriction_nms * s.speed_rad_s) / kInertia_kgm2};
    });
    const Phases i = phases_of(x.machine);
    const double largest_a = std::max({std::abs(i[0]), std::abs(i[1]), std::abs(i[2])});
    run.peak_a = std::max(run.peak_a, largest_a);
    if (n < kSteps - 100'000) continue;
    run.mean_rad_s += x.speed_rad_s / 100'000.0;
    run.lowest_rad_s = std::min(run.lowest_rad_s, x.speed_rad_s);
    run.highest_rad_s = std::max(run.highest_rad_s, x.speed_rad_s);
    run.late_peak_a = std::max(run.late_peak_a, largest_a);
  }
  return run;
}

// AC-28, tolerances of the reference (5 %; half a unit of the last digit for the speeds). Catches: a star
// with the neutral left in, a drive that turns the wrong way.
TEST(BldcPhases, TheOpenLoopTrapezoidalDriveSynchronisesAsInTheReference) {
  const DriveRun calm = trapezoidal_drive(33.0);
  EXPECT_NEAR(calm.mean_rad_s, 62.83, 0.01);
  EXPECT_NEAR(calm.lowest_rad_s, 60.7, 0.05);
  EXPECT_NEAR(calm.highest_rad_s, 67.0, 0.05);
  EXPECT_NEAR(calm.peak_a, 10.4, 0.05);
  EXPECT_NEAR(calm.late_peak_a, 4.35, 0.05 * 4.35);
  const DriveRun violent = trapezoidal_drive(200.0);
  EXPECT_NEAR(violent.mean_rad_s, 62.83, 0.05 * 62.83);
  EXPECT_NEAR(violent.late_peak_a, 324.0, 0.05 * 324.0);
}

}  // namespace
}  // namespace drivebench::bldc_phases_test
