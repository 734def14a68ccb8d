// Voltages of an open terminal, against the phase equations solved here with finite differences of the
// fluxes.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>

#include "plant/axis.hpp"

namespace drivebench::open_phase_test {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr AxisTiming kTiming{.period_s = 1e-4, .substeps = 10};
constexpr PhaseCommand kVolts{.gates = Gates::kVoltage, .setpoint = {.a = 31.0, .b = -17.0, .c = 8.0}};

using Phases = std::array<double, 3>;

/// Three windings and a field.
struct Circuit {
  Phases stator{};
  double field = 0.0;
};

/// The equations of a machine: the fluxes of its windings for currents and electrical angle.
struct Machine {
  std::function<Circuit(const Circuit& current_a, double electrical_rad)> flux_wb;
  double resistance_ohm = 0.0;
  double field_resistance_ohm = 0.0;
  double pole_pairs = 1.0;
  bool has_field = false;
};

/// R i + d(flux)/dt for these slopes of the currents.
Circuit voltages(const Machine& m, const Circuit& i, const Circuit& slope, double angle_rad,
                 double speed_rad_s) {
  constexpr double kDt_s = 1e-7;
  const auto flux_at = [&](double t) {
    Circuit moved = i;
    for (std::size_t k = 0; k < 3; ++k)
      moved.stator[k] += t * slope.stator[k];
    moved.field += t * slope.field;
    return m.flux_wb(moved, m.pole_pairs * (angle_rad + speed_rad_s * t));
  };
  const Circuit after = flux_at(kDt_s);
  const Circuit before = flux_at(-kDt_s);
  Circuit v{.field = m.field_resistance_ohm * i.field + (after.field - before.field) / (2.0 * kDt_s)};
  for (std::size_t k = 0; k < 3; ++k)
    v.stator[k] = m.resistance_ohm * i.stator[k] + (after.stator[k] - before.stator[k]) / (2.0 * kDt_s);
  return v;
}

/// The slopes x, y that solve two equations which are linear in them.
std::array<double, 2> solved(const std::function<std::array<double, 2>(double, double)>& residual) {
  const auto r = residual(0.0, 0.0);
  const auto rx = residual(1.0, 0.0);
  const auto ry = residual(0.0, 1.0);
  const double a = rx[0] - r[0], b = ry[0] - r[0], c = rx[1] - r[1], d = ry[1] - r[1];
  const double det = a * d - b * c;
  return {(-r[0] * d + r[1] * b) / det, (-a * r[1] + c * r[0]) / det};
}

/// Terminal k of a star is open; the others are at these voltages.
double floating_v(const Machine& m, const Circuit& i, double angle_rad, double speed_rad_s,
                  const Phases& driven_v, double field_v, std::size_t k) {
  const std::size_t p = (k + 1) % 3;
  const std::size_t q = (k + 2) % 3;
  const auto at_slopes = [&](double line, double field) {
    Circuit slope{.field = field};
    slope.stator[p] = line;
    slope.stator[q] = -line;
    return voltages(m, i, slope, angle_rad, speed_rad_s);
  };
  const auto slopes = solved([&](double line, double field) -> std::array<double, 2> {
    const Circuit v = at_slopes(line, field);
    return {v.stator[p] - v.stator[q] - (driven_v[p] - driven_v[q]), m.has_field ? v.field - field_v : field};
  });
  const Circuit v = at_slopes(slopes[0], slopes[1]);
  return driven_v[p] - v.stator[p] + v.stator[k];
}

/// Flux of a star from that of the two-phase equivalent.
Phases in_phases(double along_a, double along_b) {
  Phases result{};
  for (std::size_t k = 0; k < 3; ++k) {
    const double axis_rad = 2.0 * kPi / 3.0 * static_cast<double>(k);
    result[k] = std::sqrt(2.0 / 3.0) * (std::cos(axis_rad) * along_a + std::sin(axis_rad) * along_b);
  }
  return result;
}

std::array<double, 2> in_plane(const Phases& x) {
  std::array<double, 2> result{};
  for (std::size_t k = 0; k < 3; ++k) {
    const double axis_rad = 2.0 * kPi / 3.0 * static_cast<double>(k);
    result[0] += std::sqrt(2.0 / 3.0) * std::cos(axis_rad) * x[k];
    result[1] += std::sqrt(2.0 / 3.0) * std::sin(axis_rad) * x[k];
  }
  return result;
}

AxisParameters turned_axis(const MachineParameters& machine) {
  AxisParameters p;
  p.machine = machine;
  p.mechanics = {.inertia_kgm2 = 1e-3, .motion = ShaftMotion::kImposed, .imposed_speed_rad_s = 60.0};
  p.drive.amplifier = {.voltage_limit_v = 200.0, .over_current_a = 1e4};
  return p;
}

/// The axis after 50 ticks with terminal k open, or all connected.
Axis run(const AxisParameters& p, int k, const PhaseCommand& command = kVolts) {
  Axis axis(p, kTiming, 1, 0);
  axis.inject(find_injectable_fault("open_phase"), k + 1.0);
  for (Tick tick = 0; tick < 50; ++tick)
    axis.advance(command, tick);
  return axis;
}

Circuit currents(const Axis& axis) {
  const Sample s = axis.sample(50);
  return {.stator = {s.true_i_a_a, s.true_i_b_a, s.true_i_c_a}, .field = s.true_i_f_a};
}

Phases terminal_v(const Axis& axis) {
  const PhaseValues v = axis.state().voltage_v;
  return {v.a, v.b, v.c};
}

/// Every terminal in turn. The differences of the fluxes are exact to 1e-7 of 100 V.
void expect_floating_voltages(const AxisParameters& p, const Machine& m, double field_v) {
  for (std::size_t k = 0; k < 3; ++k) {
    const Axis axis = run(p, static_cast<int>(k));
    const Circuit i = currents(axis);
    ASSERT_EQ(i.stator[k], 0.0);
    ASSERT_GT(std::abs(i.stator[(k + 1) % 3]), 0.5);
    const Phases driven_v{kVolts.setpoint.a, kVolts.setpoint.b, kVolts.setpoint.c};
    const Sample s = axis.sample(50);
    EXPECT_NEAR(terminal_v(axis)[k], floating_v(m, i, s.angle_rad, s.speed_rad_s, driven_v, field_v, k), 1e-5)
        << k;
  }
}

// Catches: a floating terminal that does not feel the saliency.
TEST(OpenPhase, AnOpenPhaseOfASalientMachineSeesTheCurrentOfTheOthers) {
  const PmMachineParameters p{.pole_pairs = 3,
                              .stator_resistance_ohm = 0.4,
                              .inductance_d_h = 4e-3,
                              .inductance_q_h = 9e-3,
                              .torque_constant_nm_per_a = 0.3,
                              .star = true};
  const Machine m{.flux_wb =
                      [&](const Circuit& i, double e_rad) {
                        const auto [a, b] = in_plane(i.stator);
                        const double cos = std::cos(e_rad), sin = std::sin(e_rad);
                        const double d =
                            p.inductance_d_h * (cos * a + sin * b) + p.torque_constant_nm_per_a / 3.0;
                        const double q = p.inductance_q_h * (cos * b - sin * a);
                        return Circuit{.stator = in_phases(cos * d - sin * q, sin * d + cos * q)};
                      },
                  .resistance_ohm = 0.4,
                  .pole_pairs = 3.0};
  expect_floating_voltages(turned_axis(p), m, 0.0);
}

constexpr WoundRotorMachineParameters kWound{.pole_pairs = 2,
                                             .stator_resistance_ohm = 0.75,
                                             .field_resistance_ohm = 5.0,
                                             .stator_inductance_h = 0.02,
                                             .field_inductance_h = 0.9,
                                             .mutual_inductance_h = 0.12,
                                             .star = true};

// Catches: a floating terminal that does not feel the slope of the field current.
TEST(OpenPhase, AnOpenPhaseOfAWoundRotorMachineSeesTheFieldChange) {
  AxisParameters p = turned_axis(kWound);
  p.drive.source.field_v = 40.0;
  const Machine m{.flux_wb =
                      [](const Circuit& i, double e_rad) {
                        const auto [a, b] = in_plane(i.stator);
                        const double cos = std::cos(e_rad), sin = std::sin(e_rad);
                        return Circuit{.stator = in_phases(0.02 * a + 0.12 * i.field * cos,
                                                           0.02 * b + 0.12 * i.field * sin),
                                       .field = 0.9 * i.field + 0.12 * (a * cos + b * sin)};
                      },
                  .resistance_ohm = 0.75,
                  .field_resistance_ohm = 5.0,
                  .pole_pairs = 2.0,
                  .has_field = true};
  expect_floating_voltages(p, m, 40.0);
}

// The open winding has no current: its voltage is the slope of its flux, here over two ticks of 1 us (1e-6 of
// it). Catches: a floating terminal that does not feel the saturation that the others cause.
TEST(OpenPhase, AnOpenPhaseOfASaturatedMachineShowsTheSlopeOfItsFlux) {
  const SaturatedInductionMachineParameters machine{
      .pole_pairs = 2,
      .stator_resistance_ohm = 1.7,
      .rotor_resistance_ohm = 3.9,
      .stator_leakage_h = 2.3e-3,
      .rotor_leakage_h = 2.9e-3,
      .magnetising_curve = Curve({{0.0, 0.0}, {2.0, 0.02}, {10.0, 0.03}}),
      .star = true};
  Axis axis(turned_axis(machine), {.period_s = 1e-6, .substeps = 1}, 1, 0);
  axis.inject(find_injectable_fault("open_phase"), 3.0);
  Tick tick = 0;
  for (; tick < 8000; ++tick)
    axis.advance(kVolts, tick);
  const MachineWords before = axis.state().machine;
  axis.advance(kVolts, tick++);
  const double shown_v = terminal_v(axis)[2];
  axis.advance(kVolts, tick++);
  const MachineWords after = axis.state().machine;
  const double slope_v = in_phases((after[0] - before[0]) / 2e-6, (after[1] - before[1]) / 2e-6)[2];
  EXPECT_GT(std::abs(axis.sample(tick).true_i_a_a), 2.0);
  EXPECT_NEAR(shown_v, 0.5 * (kVolts.setpoint.a + kVolts.setpoint.b) + 1.5 * slope_v, 1e-4);
}

constexpr BldcMachineParameters kBrushless{.pole_pairs = 2,
                                           .stator_resistance_ohm = 0.7,
                                           .self_inductance_h = 2.7e-3,
                                           .mutual_inductance_h = 0.8e-3,
                                           .torque_constant_nm_per_a = 0.2};

/// The emf of the phases for the terminal voltage, -e_p w e.
Phases emf_v(double electrical_rad, double speed_rad_s) {
  Phases result{};
  for (std::size_t k = 0; k < 3; ++k) {
    const double x = std::asin(std::sin(electrical_rad - 2.0 * kPi / 3.0 * static_cast<double>(k)));
    result[k] = -0.2 * speed_rad_s * std::clamp(6.0 / kPi * x, -1.0, 1.0);
  }
  return result;
}

// With i_p' = -i_q' the mutual fluxes of the two cancel in the third, whose emf is left: the neutral is where
// the two have it. Catches: a star whose trapezoids are taken for sines.
TEST(OpenPhase, AnOpenPhaseOfABrushlessStarShowsItsEmfAboveTheNeutral) {
  BldcMachineParameters machine = kBrushless;
  machine.star = true;
  for (std::size_t k = 0; k < 3; ++k) {
    const Axis axis = run(turned_axis(machine), static_cast<int>(k));
    const Sample s = axis.sample(50);
    const Phases e = emf_v(2.0 * s.angle_rad, s.speed_rad_s);
    const Phases v = terminal_v(axis);
    const std::size_t p = (k + 1) % 3;
    const std::size_t q = (k + 2) % 3;
    EXPECT_NEAR(v[k], 0.5 * (v[p] - e[p] + v[q] - e[q]) + e[k], 1e-9) << k;
  }
}

// L_S i_p' - M i_q' = u_p - R i_p - emf_p, and what is open has emf - M (i_p' + i_q'). Catches: independent
// phases that do not couple where one is open.
TEST(OpenPhase, AnOpenPhaseOfThreeIndependentOnesSeesTheMutualInductance) {
  BldcMachineParameters machine = kBrushless;
  machine.star = false;
  for (std::size_t k = 0; k < 3; ++k) {
    const Axis axis = run(turned_axis(machine), static_cast<int>(k));
    const Sample s = axis.sample(50);
    const Phases e = emf_v(2.0 * s.angle_rad, s.speed_rad_s);
    const Phases v = terminal_v(axis);
    const Circuit i = currents(axis);
    const std::size_t p = (k + 1) % 3;
    const std::size_t q = (k + 2) % 3;
    const auto slopes = solved([&](double ip, double iq) -> std::array<double, 2> {
      return {2.7e-3 * ip - 0.8e-3 * iq - (v[p] - 0.7 * i.stator[p] - e[p]),
              2.7e-3 * iq - 0.8e-3 * ip - (v[q] - 0.7 * i.stator[q] - e[q])};
    });
    EXPECT_NEAR(v[k], e[k] - 0.8e-3 * (slopes[0] + slopes[1]), 1e-9) << k;
  }
}

// At standstill the field, switched on, induces M/L_F u_F along phase a: sqrt(3/2) of that between a and the
// others, against two rails of 5 V, below which nothing flows. Catches: diodes that ask for the emf of
// rotation alone.
TEST(OpenPhase, AFieldThatRisesFeedsTheDiodesAtStandstill) {
  for (const double field_v : {55.0, 70.0}) {
    AxisParameters p = turned_axis(kWound);
    p.mechanics.motion = ShaftMotion::kLocked;
    p.drive.amplifier.voltage_limit_v = 5.0;
    p.drive.source.field_v = field_v;
    Axis axis(p, kTiming, 1, 0);
    axis.advance({.gates = Gates::kOff}, 0);
    const Sample s = axis.sample(1);
    if (std::sqrt(1.5) * 0.12 / 0.9 * field_v < 10.0) {
      EXPECT_EQ(s.true_i_a_a, 0.0);
    } else {
      EXPECT_LT(s.true_i_a_a, 0.0) << "into the upper rail";
      EXPECT_NEAR(s.true_i_a_a + s.true_i_b_a + s.true_i_c_a, 0.0, 1e-12);
    }
    EXPECT_GT(s.true_i_f_a, 0.0);
  }
}

}  // namespace
}  // namespace drivebench::open_phase_test
