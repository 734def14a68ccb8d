// The two-phase equivalent in a star against an independent model of the three phases.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <random>

#include "plant/machines/induction/induction_machine.hpp"
#include "plant/math/rk4.hpp"
#include "tests/plant/induction_motors.hpp"
#include "tests/plant/power_balance.hpp"

namespace drivebench::three_phase_induction_test {
namespace {

using namespace induction_motors;
using Phases = std::array<double, 3>;

constexpr double kThird_rad = 2.0 * std::numbers::pi / 3.0;

constexpr double kPhasePeakB_v = 208.0 * std::numbers::sqrt2 / std::numbers::sqrt3;

double sum(const Phases& x) {
  return x[0] + x[1] + x[2];
}
Phases phases(TwoPhase x) {
  const ThreePhase three = two_to_three(x);
  return {three.a, three.b, three.c};
}
TwoPhase plane(const Phases& x) {
  return three_to_two({x[0], x[1], x[2]});
}
Phases values(const ThreePhase& x) {
  return {x.a, x.b, x.c};
}

/// P3-01: six currents, the rotor's in coordinates of the rotor, both neutrals isolated.
struct SixCurrents {
  ThreePhase stator;
  ThreePhase rotor;
  double angle_rad;
  double speed_rad_s;
};

/// C1 of P3-01 times i.
double own_flux(double inductance_h, const Phases& i, std::size_t k) {
  return 2.0 / 3.0 * inductance_h * (i[k] - 0.5 * (sum(i) - i[k]));
}

double coupling_angle(double electrical_rad, std::size_t stator, std::size_t rotor) {
  return electrical_rad + (static_cast<double>(rotor) - static_cast<double>(stator)) * kThird_rad;
}

/// The compact form of the torque.
double six_current_torque_nm(const InductionMachineParameters& p, const SixCurrents& x) {
  const Phases i_s = values(x.stator);
  const Phases i_r = values(x.rotor);
  double result = 0.0;
  for (std::size_t s = 0; s < 3; ++s) {
    for (std::size_t r = 0; r < 3; ++r)
      result -= i_r[r] * i_s[s] * std::sin(coupling_angle(p.pole_pairs * x.angle_rad, s, r));
  }
  return 2.0 / 3.0 * p.pole_pairs * p.mutual_inductance_h * result;
}

template <std::size_t n>
std::array<double, n> solved(std::array<std::array<double, n + 1>, n> m) {
  for (std::size_t column = 0; column < n; ++column) {
    const auto larger = [column](const auto& x, const auto& y) {
      return std::abs(x[column]) < std::abs(y[column]);
    };
    std::iter_swap(m.begin() + static_cast<std::ptrdiff_t>(column),
                   std::max_element(m.begin() + static_cast<std::ptrdiff_t>(column), m.end(), larger));
    for (std::size_t row = 0; row < n; ++row) {
      if (row == column) continue;
      const double factor = m[row][column] / m[column][column];
      for (std::size_t k = column; k <= n; ++k)
        m[row][k] -= factor * m[column][k];
    }
  }
  std::array<double, n> x{};
  for (std::size_t k = 0; k < n; ++k)
    x[k] = m[k][n] / m[k][k];
  return x;
}

struct SixSlopes {
  Phases stator;
  Phases rotor;
  double neutral_v;
  double open_terminal_v;  ///< of phase c if its wire is broken
};

/// Both sides' voltage equations, sum i_S' = 0 with the unknown voltage of the neutral, and if the wire of
/// phase c is broken i_c' = 0 with its unknown terminal voltage.
SixSlopes six_slopes(const InductionMachineParameters& p, const SixCurrents& x, const Phases& u,
                     bool open_c) {
  const Phases i_s = values(x.stator);
  const Phases i_r = values(x.rotor);
  const double electrical_rad = p.pole_pairs * x.angle_rad;
  const double omega_e = p.pole_pairs * x.speed_rad_s;
  const double mutual_h = 2.0 / 3.0 * p.mutual_inductance_h;
  std::array<std::array<double, 9>, 8> m{};
  for (std::size_t k = 0; k < 3; ++k) {
    auto& stator = m[k];
    auto& rotor = m[3 + k];
    stator[8] = (open_c && k == 2 ? 0.0 : u[k]) - p.stator_resistance_ohm * i_s[k];
    rotor[8] = -p.rotor_resistance_ohm * i_r[k];
    for (std::size_t j = 0; j < 3; ++j) {
      Phases unit{};
      unit[j] = 1.0;
      stator[j] = own_flux(p.stator_inductance_h, unit, k);
      // The rotor's zero sequence has no flux; any inductance keeps its current at zero.
      rotor[3 + j] = own_flux(p.rotor_inductance_h, unit, k) + p.rotor_inductance_h;
      const double stator_angle = coupling_angle(electrical_rad, k, j);
      const double rotor_angle = coupling_angle(electrical_rad, j, k);
      stator[3 + j] = mutual_h * std::cos(stator_angle);
      rotor[j] = mutual_h * std::cos(rotor_angle);
      stator[8] += omega_e * mutual_h * std::sin(stator_angle) * i_r[j];
      rotor[8] += omega_e * mutual_h * std::sin(rotor_angle) * i_s[j];
    }
    stator[6] = 1.0;
    m[6][k] = 1.0;
  }
  if (open_c) {
    m[2][7] = -1.0;
    m[7][2] = 1.0;
  } else {
    m[7][7] = 1.0;
  }
  const auto y = solved<8>(m);
  return {{y[0], y[1], y[2]}, {y[3], y[4], y[5]}, y[6], y[7]};
}

struct Turning {
  InductionMachineState machine;
  double speed_rad_s;
};

// The test vector of P3-01. Catches: a transform with another factor, a rotor seen from the wrong side.
TEST(ThreePhaseInduction, TorqueAndFluxesOfTheTestVectorAreThoseOfTheReference) {
  InductionMachineParameters p = kMotorA;
  p.pole_pairs = 1;
  const SixCurrents x{{3.0, -1.0, -2.0}, {1.5, -2.0, 0.5}, 0.7, 0.0};
  EXPECT_NEAR(six_current_torque_nm(p, x), 0.02829244, 1e-8);
  const TwoPhase i_s = three_to_two(x.stator);
  const TwoPhase i_r = three_to_two(x.rotor);
  EXPECT_NEAR(i_s.a, 3.674235, 1e-6);
  EXPECT_NEAR(i_s.b, 0.707107, 1e-6);
  EXPECT_NEAR(i_r.a, 1.837117, 1e-6);
  EXPECT_NEAR(i_r.b, -1.767767, 1e-6);
  const TwoPhase turned_r = to_ab({.d = i_r.a, .q = i_r.b}, {.cos = std::cos(0.7), .sin = std::sin(0.7)});
  const InductionMachineState state{.i_a_a = i_s.a,
                                    .i_b_a = i_s.b,
                                    .psi_a_wb = 0.014 * turned_r.a + 0.0117 * i_s.a,
                                    .psi_b_wb = 0.014 * turned_r.b + 0.0117 * i_s.b};
  EXPECT_NEAR(torque_nm(constants_of(p), state, turning(0.0)), 0.02829244, 1e-8);
  const TwoPhase stator_wb{0.014 * i_s.a + 0.0117 * turned_r.a, 0.014 * i_s.b + 0.0117 * turned_r.b};
  EXPECT_NEAR(stator_wb.a, 0.08120328, 1e-8);
  EXPECT_NEAR(stator_wb.b, 0.00792735, 1e-8);
  const Phases psi = phases(stator_wb);
  EXPECT_NEAR(psi[0], 0.0663022, 1e-7);
  EXPECT_NEAR(psi[1], -0.0275456, 1e-7);
  EXPECT_NEAR(psi[2], -0.0387566, 1e-7);
}

/// Product and reference side by side for 20 ms of a start under an unbalanced supply with a common part.
void expect_same_phase_currents(bool open_c) {
  const InductionMachineConstants c = constants_of(kMotorA);
  constexpr double kStep_s = 2e-6;
  Turning x{};
  SixCurrents reference{};
  x.speed_rad_s = reference.speed_rad_s = open_c ? 100.0 : 0.0;  // one phase alone does not start it
  reference.angle_rad = 0.3;
  double largest_a = 0.0;
  for (int n = 0; n < 10'000; ++n) {
    const double phase = kLine_rad_s * kStep_s * n;
    const Phases u{60.0 * std::cos(phase) + 20.0, 48.0 * std::cos(phase - kThird_rad) + 20.0,
                   60.0 * std::cos(phase + kThird_rad) + 20.0};
    // Without phase c the current flows from a to b.
    const TerminalInput input{.voltage_v = plane(u),
                              .conduction = open_c ? Conduction::kLine : Conduction::kFull,
                              .line = {.a = 0.5 * std::numbers::sqrt3, .b = -0.5}};
    x = rk4_step(x, kStep_s, [&](const Turning& s) noexcept -> Turning {
      const RotorMotion now = turning(s.speed_rad_s);
      return {derivative(c, s.machine, now, input), torque_nm(c, s.machine, now) / kInertiaA_kgm2};
    });
    reference = rk4_step(reference, kStep_s, [&](const SixCurrents& s) noexcept -> SixCurrents {
      const SixSlopes slope = six_slopes(kMotorA, s, u, open_c);
      return {{slope.stator[0], slope.stator[1], slope.stator[2]},
              {slope.rotor[0], slope.rotor[1], slope.rotor[2]},
              s.speed_rad_s,
              six_current_torque_nm(kMotorA, s) / kInertiaA_kgm2};
    });
    const Phases i = phases(winding_currents(c, x.machine, turning(0.0)).stator);
    ASSERT_NEAR(i[0], reference.stator.a, 1e-9) << n;
    ASSERT_NEAR(i[1], reference.stator.b, 1e-9) << n;
    ASSERT_NEAR(i[2], reference.stator.c, 1e-9) << n;
    ASSERT_NEAR(x.speed_rad_s, reference.speed_rad_s, 1e-8);
    const SixSlopes slope = six_slopes(kMotorA, reference, u, open_c);
    if (open_c) {
      // The voltage between the open terminal and the neutral is the emf of its winding.
      const WindingValues open_v = open_circuit_voltages(c, x.machine, turning(x.speed_rad_s));
      ASSERT_NEAR(slope.open_terminal_v - slope.neutral_v, phases(open_v.stator)[2], 1e-6);
    } else {
      ASSERT_NEAR(slope.neutral_v, neutral({u[0], u[1], u[2]}), 1e-9);
    }
    largest_a = std::max(largest_a, std::abs(i[0]));
  }
  EXPECT_GT(largest_a, 8.0);
  EXPECT_GT(std::abs(x.speed_rad_s - (open_c ? 100.0 : 0.0)), 5.0);
}

// Both integrate with steps of 2 us, of which RK4 makes errors of 1e-11 A. Catches: two-phase values that are
// not the equivalents of the phases, a neutral that is left in, a wrong sense of rotation.
TEST(ThreePhaseInduction, PhaseCurrentsAreThoseOfTheFullThreePhaseModel) {
  expect_same_phase_currents(false);
}

// Catches: an open phase that still takes part, a line across the one in which the current flows.
TEST(ThreePhaseInduction, WithOneWireBrokenTheCurrentsAreThoseOfTheConstrainedModel) {
  expect_same_phase_currents(true);
}

// AC-20, AC-21. Catches: a transform that keeps amplitudes, a neutral with a factor sqrt(3).
TEST(ThreePhaseInduction, TransformAndLeakageHaveTheValuesOfTheReference) {
  const TwoPhase u = plane({kPhasePeakB_v, -0.5 * kPhasePeakB_v, -0.5 * kPhasePeakB_v});
  EXPECT_NEAR(kPhasePeakB_v, 169.831, 5e-4);
  EXPECT_NEAR(u.a, 208.0, 1e-6);
  EXPECT_NEAR(u.b, 0.0, 1e-6);
  const ThreePhase one{100.0, 0.0, 0.0};
  EXPECT_NEAR(neutral(one), 100.0 / 3.0, 1e-12);
  EXPECT_NEAR(std::sqrt(3.0) * neutral(one), 57.735, 5e-4);
  EXPECT_NEAR(three_to_two(one).a, 81.650, 5e-4);
  EXPECT_NEAR(three_to_two(one).b, 0.0, 1e-12);
  // The phases of the motor see (66.667, -33.333, -33.333): at rest their currents rise in that ratio.
  const InductionMachineState slope =
      derivative(constants_of(kMotorA), {}, turning(0.0), {.voltage_v = three_to_two(one)});
  const Phases rate = phases({slope.i_a_a, slope.i_b_a});
  EXPECT_NEAR(rate[0] * 4.22214e-3, 66.667, 1e-3);
  EXPECT_NEAR(rate[1] * 4.22214e-3, -33.333, 1e-3);
  EXPECT_NEAR(rate[2] * 4.22214e-3, -33.333, 1e-3);

  EXPECT_NEAR(leakage_factor(kMotorA), 0.30158, 1e-4);
  EXPECT_NEAR(leakage_factor(kMotorB), 0.14967, 1e-4);
  EXPECT_NEAR(leakage_factor(kMotorC), 0.111364, 1e-6);
  const double coupling_squared = 0.0117 * 0.0117 / (0.014 * 0.014);
  EXPECT_NEAR(leakage_factor(kMotorA), 1.0 - coupling_squared, 1e-15);
  EXPECT_EQ(connection_of(kMotorA), Connection::kStar);
}

// Case 3 with the power of three phases, common voltage included. Catches: a transform that is not power
// invariant.
TEST(ThreePhaseInduction, ThePowerOfThePhasesIsStoredLostOrDelivered) {
  std::mt19937_64 engine(41);
  const auto draw = [&engine](double size) {
    return std::uniform_real_distribution<double>(-size, size)(engine);
  };
  const InductionMachineConstants c = constants_of(kMotorB);
  for (int n = 0; n < 10'000; ++n) {
    const Phases u{draw(200.0), draw(200.0), draw(200.0)};
    const InductionMachineState x{draw(20.0), draw(20.0), draw(1.0), draw(1.0)};
    const RotorMotion now = turning(draw(200.0));
    const InductionMachineState slope = derivative(c, x, now, {.voltage_v = plane(u)});
    const Phases i = phases({x.i_a_a, x.i_b_a});
    const double in_w = u[0] * i[0] + u[1] * i[1] + u[2] * i[2];
    const double size_w = std::abs(u[0] * i[0]) + std::abs(u[1] * i[1]) + std::abs(u[2] * i[2]);
    ASSERT_NEAR(in_w,
                storing_w(c, x, now, slope) + losses_w(c, x, now) + torque_nm(c, x, now) * now.speed_rad_s,
                1e-9 * size_w);
  }
}

}  // namespace
}  // namespace drivebench::three_phase_induction_test
