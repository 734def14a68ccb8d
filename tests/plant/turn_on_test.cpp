// The instants at which the diodes of a bridge begin to conduct.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "tests/plant/bridge_rig.hpp"
#include "tests/plant/servo_axis.hpp"

namespace drivebench::turn_on_test {
namespace {

using namespace bridge_rig;
using enum LegLevel;

constexpr PhaseCommand kAllOff{.gates = Gates::kOff};
const LegEdgeList kStaysLow = list({{0, kLow}});

/// The first instant at which a condition on the electrical angle of a turning rotor holds, by bisection.
template <class Holds>
double first_instant(double from_s, double to_s, Holds holds) {
  double before_s = from_s;
  double after_s = to_s;
  while (!holds(after_s)) {
    before_s = after_s;
    after_s += to_s - from_s;
  }
  // The condition changes once in a step of the caller.
  for (int n = 0; n < 80; ++n) {
    const double middle_s = 0.5 * (before_s + after_s);
    (holds(middle_s) ? after_s : before_s) = middle_s;
  }
  return after_s;
}

struct Emf {
  PmMachineConstants c;
  double speed_rad_s;
  double start_rad = 0.0;
  std::array<double, 3> at(double time_s) const {
    const double angle_rad = start_rad + speed_rad_s * time_s;
    const double electrical_rad = c.pole_pairs * angle_rad;
    const RotorMotion motion{.angle_rad = angle_rad,
                             .speed_rad_s = speed_rad_s,
                             .electrical = {std::cos(electrical_rad), std::sin(electrical_rad)}};
    const ThreePhase v = two_to_three(open_circuit_voltages(c, {}, motion).stator);
    return {v.a, v.b, v.c};
  }
};

AxisParameters turning_motor(double speed_rad_s) {
  AxisParameters p = standing_motor();
  p.mechanics.motion = ShaftMotion::kImposed;
  p.mechanics.imposed_speed_rad_s = speed_rad_s;
  return p;
}

constexpr double kForward_v[] = {0.0, 0.6};

// The emf between two terminals of an open star passes the link and two diodes: there both begin to conduct.
// Catches: a turn-on that waits for the end of a substep, or that leaves the forward voltages out.
TEST(TurnOn, DiodesOfAnOpenStarBeginToConductAtTheirInstant) {
  constexpr double kSpeed_rad_s = 1400.0;
  constexpr double kStart_rad = 0.05;  // 20 electrical degrees behind a top of the emf between two terminals
  for (const double diode_v : kForward_v) {
    AxisParameters p = turning_motor(kSpeed_rad_s);
    p.drive.inverter.diode_v = diode_v;
    Axis axis(p, {.period_s = kTick_s, .substeps = 2}, 1, 0);
    spin(axis, kSpeed_rad_s, kStart_rad);
    const Emf emf{constants_of(pm(p)), kSpeed_rad_s, kStart_rad};
    // Peak between terminals: sqrt(2) K_m w = 25.5 V.
    const double conducts_s = first_instant(0.0, 1e-6, [&](double time_s) {
      const std::array<double, 3> v = emf.at(time_s);
      return std::max({v[0], v[1], v[2]}) - std::min({v[0], v[1], v[2]}) > kLink_v + 2.0 * diode_v;
    });
    Tick tick = 0;
    for (; events(axis).empty() && tick < 100; ++tick) {
      axis.advance(kAllOff, tick);
    }
    ASSERT_FALSE(events(axis).empty());
    // The search ends within 0.1 ns on this top.
    EXPECT_NEAR(events(axis)[0] + static_cast<double>(tick - 1) * kTick_s, conducts_s, 1e-9) << diode_v;
  }
}

// Two legs at the lower rail hold the star, and the emf carries the third terminal below that rail by V_f:
// 1.5 times the emf of its phase. Catches: a turn-on against the rail alone or not looked for with ideal
// diodes, a neutral that counts the open terminal, a diode that begins with a residue and dies at once.
TEST(TurnOn, AFloatingTerminalBeginsToConductBelowTheRailByItsDiode) {
  constexpr double kSpeed_rad_s = 300.0;
  for (const double diode_v : kForward_v) {
    AxisParameters p = turning_motor(kSpeed_rad_s);
    p.drive.inverter.diode_v = diode_v;
    Axis axis(p, {.period_s = kTick_s, .substeps = 2}, 1, 0);
    spin(axis, kSpeed_rad_s, -0.02);
    const Emf emf{constants_of(pm(p)), kSpeed_rad_s, -0.02};
    const double conducts_s =
        first_instant(0.0, 1e-6, [&](double time_s) { return 1.5 * emf.at(time_s)[0] < -diode_v; });
    Tick tick = 0;
    for (; events(axis).empty() && tick < 100; ++tick)
      axis.advance(legs({}, kStaysLow, kStaysLow), tick);
    ASSERT_EQ(events(axis).size(), 1u) << "one begins, none dies";
    EXPECT_NEAR(events(axis)[0] + static_cast<double>(tick - 1) * kTick_s, conducts_s, 1e-12) << diode_v;
    axis.advance(legs({}, kStaysLow, kStaysLow), tick);
    EXPECT_GT(currents(axis)[0], 0.0) << "from the lower rail into the motor";
  }
}

/// When a current is zero again that begins at from_s behind R and L, by Simpson's rule; it is not before a
/// quarter of longest_s has passed.
template <class Voltage>
double dies_s(double from_s, double longest_s, const Voltage& voltage_v) {
  const auto volt_seconds = [&](double to_s) {
    constexpr int kSteps = 400;
    double sum = 0.0;
    for (int n = 0; n <= kSteps; ++n) {
      const double at_s = from_s + (to_s - from_s) * n / kSteps;
      const double weight = n == 0 || n == kSteps ? 1.0 : n % 2 == 1 ? 4.0 : 2.0;
      sum += weight * std::exp((at_s - to_s) / kTime_s) * voltage_v(at_s);
    }
    return sum * (to_s - from_s);
  };
  return first_instant(from_s + 0.25 * longest_s, from_s + 0.5 * longest_s,
                       [&](double time_s) { return volt_seconds(time_s) < 0.0; });
}

// Two legs close at the lower rail 5 us before the emf of the third leaves it: its diode conducts for about
// 10 us, less than a step, behind R, L, the emf and a third of its forward voltage less. Catches: a current
// that is looked for only where it does not begin at zero, and then goes on against its diode or is clamped
// to the other rail; the residue of rounding at its start taken for its end.
TEST(TurnOn, APulseWithinAStepEndsAtItsInstant) {
  constexpr double kSpeed_rad_s = 300.0;
  constexpr double kAhead_s = 5e-6;
  for (std::size_t k = 0; k < 3; ++k) {
    for (const double diode_v : kForward_v) {
      AxisParameters p = turning_motor(kSpeed_rad_s);
      p.drive.inverter.diode_v = diode_v;
      const Emf from_zero{constants_of(pm(p)), kSpeed_rad_s};
      const auto is_beyond = [&](double time_s) { return 1.5 * from_zero.at(time_s)[k] < -diode_v; };
      const double beyond_s = first_instant(0.0, 1e-6, is_beyond);
      const double leaves_s =
          first_instant(beyond_s + 1e-6, beyond_s + 2e-6, [&](double time_s) { return !is_beyond(time_s); });
      const double start_rad = kSpeed_rad_s * (leaves_s - kAhead_s);
      const Emf emf{constants_of(pm(p)), kSpeed_rad_s, start_rad};
      const double expected_s =
          dies_s(0.0, 20e-6, [&](double time_s) { return -2.0 / 3.0 * diode_v - emf.at(time_s)[k]; });

      Axis axis(p, {.period_s = kTick_s, .substeps = 2}, 1, 0);
      spin(axis, kSpeed_rad_s, start_rad);
      PhaseCommand command = legs(kStaysLow, kStaysLow, kStaysLow);
      command.edges[k] = {};
      axis.advance(command, 0);
      ASSERT_EQ(events(axis).size(), 1u) << k << " " << diode_v;
      EXPECT_NEAR(events(axis)[0], expected_s, 1e-11) << k << " " << diode_v;
      EXPECT_GT(expected_s, 1.9 * kAhead_s);
      EXPECT_EQ(currents(axis)[k], 0.0) << k << " " << diode_v;
    }
  }
}

AxisParameters charging_motor(double diode_v, bool battery) {
  AxisParameters p = turning_motor(1700.0);  // 31 V between two terminals
  p.drive.inverter.diode_v = diode_v;
  p.drive.bus.capacitance_f = battery ? 0.5e-3 : 0.3e-3;
  p.drive.bus.battery = battery;
  if (battery) p.drive.bus.resistance_ohm = 0.03;
  return p;
}

/// Line currents of a motor that turns faster than its link allows, at each tick of 50 us, and the most
/// pieces in a tick.
struct Charging {
  std::vector<double> current_a{};
  std::size_t pieces = 0;

  Charging(const AxisParameters& p, int substeps) {
    Axis axis(p, {.period_s = kTick_s, .substeps = substeps}, 1, 0);
    spin(axis, 1700.0);
    for (Tick tick = 0; tick < 200; ++tick) {
      axis.advance(kAllOff, tick);
      for (const double i_a : currents(axis))
        current_a.push_back(i_a);
      pieces = std::max(pieces, axis.last_tick().size());
    }
  }
};

// The motor charges a capacitor or a battery through its diodes: a rail moves away from the terminal that has
// just passed it. Against 64 steps of a tick the currents err in 2 by a twentieth, on a battery, whose link
// is foreseen, by a thousandth; if a diode waits for the next step, by a seventh of both. Catches: a turn-on
// that is found again and again until a piece has no events left and a current passes zero in its diode.
TEST(TurnOn, ARailThatMovesAwayIsMetOnce) {
  for (const bool battery : {false, true}) {
    for (const double diode_v : kForward_v) {
      const AxisParameters p = charging_motor(diode_v, battery);
      const Charging fine(p, 64);
      const Charging coarse(p, 2);
      double most_a = 0.0;
      double error_a = 0.0;
      for (std::size_t n = 0; n < fine.current_a.size(); ++n) {
        most_a = std::max(most_a, std::abs(fine.current_a[n]));
        error_a = std::max(error_a, std::abs(coarse.current_a[n] - fine.current_a[n]));
      }
      EXPECT_GT(most_a, 4.0);
      EXPECT_LT(error_a, (battery ? 0.002 : 0.1) * most_a) << diode_v;
      EXPECT_LE(coarse.pieces, 6U) << diode_v;
    }
  }
}

// At many speeds and angles: where a diode begins shortly before the end of a step its rail may still be
// moving on. Catches: a current that is left against the direction of its diode there.
TEST(TurnOn, CurrentsGoTheWayOfTheirDiodes) {
  for (int n = 60; n < 90; ++n) {
    AxisParameters p = charging_motor(n % 2 == 0 ? 0.0 : 0.6, n % 3 != 0);
    p.mechanics.imposed_speed_rad_s = 1300.0 + 3.0 * n;
    Axis axis(p, {.period_s = kTick_s, .substeps = 2}, 1, 0);
    spin(axis, p.mechanics.imposed_speed_rad_s, 0.01 * n);
    for (Tick tick = 0; tick < 300; ++tick) {
      axis.advance(kAllOff, tick);
      const ThreePhase& v = axis.state().terminal_v;
      const double middle_v = 0.5 * axis.state().drive.bus_v;
      const std::array<double, 3> i_a = currents(axis);
      ASSERT_LE(i_a[0] * (v.a - middle_v), 1e-9) << n << " " << tick;
      ASSERT_LE(i_a[1] * (v.b - middle_v), 1e-9) << n << " " << tick;
      ASSERT_LE(i_a[2] * (v.c - middle_v), 1e-9) << n << " " << tick;
    }
  }
}

}  // namespace
}  // namespace drivebench::turn_on_test
