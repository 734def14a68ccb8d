// What switches and diodes of a bridge take, the instants at which diodes end to conduct, and the energy of a
// PWM period.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "plant/parameters/parameters.hpp"
#include "tests/plant/bridge_rig.hpp"
#include "tests/plant/servo_axis.hpp"

namespace drivebench::switches_test {
namespace {

using namespace bridge_rig;
using enum LegLevel;

constexpr PhaseCommand kAllOff{.gates = Gates::kOff};
const LegEdgeList kStaysHigh = list({{0, kHigh}});
const LegEdgeList kStaysLow = list({{0, kLow}});

// All legs off: the line current falls against the link and two diodes, L i' = -R i - (V/2 + V_f), to zero at
// tau ln(1 + R I/(V/2 + V_f)). Catches: a diode without its voltage, or with twice or half of it; a turn-off
// at the end of a substep.
TEST(Switches, ACurrentDiesInTheDiodesAtItsInstant) {
  for (const double diode_v : {0.0, 0.8}) {
    for (const double begun_a : {20.0, -7.0}) {
      AxisParameters p = standing_motor();
      p.drive.inverter.diode_v = diode_v;
      Axis axis(p, kTiming, 1, 0);
      set_line_current(axis, begun_a);
      axis.advance(kAllOff, 0);
      const double against_a = (0.5 * kLink_v + diode_v) / kResistance_ohm;
      const double size_a = std::abs(begun_a);
      const double later_a = (size_a + against_a) * std::exp(-kTick_s / kTime_s) - against_a;
      if (later_a > 0.0) {
        EXPECT_NEAR(currents(axis)[0], std::copysign(later_a, begun_a), 1e-9);
      }
      Tick tick = 1;
      for (; events(axis).empty() && tick < 10; ++tick)
        axis.advance(kAllOff, tick);
      const double zero_s = kTime_s * std::log(1.0 + size_a / against_a);
      ASSERT_EQ(events(axis).size(), 1u);
      // The fourth-order step errs by 1e-12 of the current; 1 ns is asked.
      EXPECT_NEAR(events(axis)[0] + static_cast<double>(tick - 1) * kTick_s, zero_s, 1e-13);
      EXPECT_EQ(currents(axis)[0], 0.0);
    }
  }
}

// A terminal on its diode is V_f beyond the rail. Catches: a terminal that stays at the rail.
TEST(Switches, ADiodeHoldsItsTerminalBeyondTheRail) {
  AxisParameters p = standing_motor();
  p.drive.inverter.diode_v = 0.8;
  Axis axis(p, kTiming, 1, 0);
  set_line_current(axis, 30.0);
  axis.advance(kAllOff, 0);
  const Sample s = axis.sample(1);
  EXPECT_NEAR(s.terminal_a_v, -0.8, 1e-12);
  EXPECT_NEAR(s.terminal_b_v, kLink_v + 0.8, 1e-12);
  EXPECT_NEAR(s.terminal_a_mean_v, -0.8, 1e-12);
}

// Leg a high, leg b low: the line current rises to V/(2 (R + R_ds)) with L/(R + R_ds), and both terminals
// leave their rails by R_ds i. Catches: a resistance of one switch for two, one that the machine does not
// see, a mean of the terminal without it.
TEST(Switches, ClosedSwitchesAreResistances) {
  constexpr double kSwitchOhm = 5e-3;
  AxisParameters p = standing_motor();
  p.drive.inverter.switch_ohm = kSwitchOhm;
  Axis axis(p, kTiming, 1, 0);
  const double total_ohm = kResistance_ohm + kSwitchOhm;
  const auto current_at = [&](double time_s) {
    return 0.5 * kLink_v / total_ohm * (1.0 - std::exp(-time_s * total_ohm / kInductance_h));
  };
  for (Tick tick = 0; tick < 20; ++tick) {
    axis.advance(legs(kStaysHigh, kStaysLow), tick);
    const double time_s = static_cast<double>(tick + 1) * kTick_s;
    const Sample s = axis.sample(tick + 1);
    ASSERT_NEAR(s.true_i_a_a, current_at(time_s), 1e-8) << tick;  // the error of 100 steps and more
    ASSERT_NEAR(s.terminal_a_v, kLink_v - kSwitchOhm * s.true_i_a_a, 1e-12);
    ASSERT_NEAR(s.terminal_b_v, kSwitchOhm * s.true_i_a_a, 1e-12);
    // c floats in the middle between them.
    ASSERT_NEAR(s.terminal_c_v, 0.5 * kLink_v, 1e-9);
    const double charge_as = 0.5 * kLink_v / total_ohm *
                             (kTick_s - kInductance_h / total_ohm *
                                            (std::exp(-(time_s - kTick_s) * total_ohm / kInductance_h) -
                                             std::exp(-time_s * total_ohm / kInductance_h)));
    // The mean takes the current linearly within a substep h: R_ds h^2/12 of what di/dt loses in T, over T.
    ASSERT_NEAR(s.terminal_a_mean_v, kLink_v - kSwitchOhm * charge_as / kTick_s, 1e-5);
  }
}

// Leg a opens with a current while leg b stays low: it goes on through one diode and one switch,
// 2 L i' = -(2 R + R_ds) i - V_f, and the open terminal c has the mean of both. Catches: two diodes for one,
// a switch resistance in the diode's path, a floating terminal that leaves them out.
TEST(Switches, AFreewheelTakesOneDiodeAndOneSwitch) {
  constexpr double kSwitchOhm = 4e-3;
  constexpr double kDiode_v = 0.7;
  AxisParameters p = standing_motor();
  p.drive.inverter.switch_ohm = kSwitchOhm;
  p.drive.inverter.diode_v = kDiode_v;
  Axis axis(p, kTiming, 1, 0);
  set_line_current(axis, 25.0);
  const double rate_per_s = (2.0 * kResistance_ohm + kSwitchOhm) / (2.0 * kInductance_h);
  const double against_a = kDiode_v / (2.0 * kResistance_ohm + kSwitchOhm);
  for (Tick tick = 0; tick < 15; ++tick) {  // then it has died
    axis.advance(legs({}, kStaysLow), tick);
    const double time_s = static_cast<double>(tick + 1) * kTick_s;
    const double current_a = (25.0 + against_a) * std::exp(-rate_per_s * time_s) - against_a;
    const Sample s = axis.sample(tick + 1);
    ASSERT_NEAR(s.true_i_a_a, current_a, 1e-9) << tick;
    ASSERT_NEAR(s.terminal_a_v, -kDiode_v, 1e-12);
    ASSERT_NEAR(s.terminal_b_v, kSwitchOhm * current_a, 1e-10);
    ASSERT_NEAR(s.terminal_c_v, 0.5 * (kSwitchOhm * current_a - kDiode_v), 1e-10);
  }
}

/// A period of edges in parts, and what flows in it. The parts are so short that Simpson's rule over two of
/// them errs by 1e-13 of its integral.
class Balance {
 public:
  static constexpr double kPart_s = 0.25e-6;
  static constexpr AxisTiming kParts{.period_s = kPart_s, .substeps = 1};

  explicit Balance(const AxisParameters& p) : p_(p), c_(constants_of(pm(p))), axis_(p, kParts, 1, 0) {}

  void start(double current_a, double speed_rad_s) {
    AxisState state = axis_.state();
    const TwoPhase i = three_to_two({current_a, -0.4 * current_a, -0.6 * current_a});
    state.machine = {i.a, i.b};
    state.open_terminals = 0;
    state.shaft.speed_rad_s = speed_rad_s;
    axis_.restore(state);
    stored_j_ = -stored();
  }

  /// Both parts with these levels: for each leg the switch that is closed, or off.
  void pass(const std::array<LegLevel, 3>& level) {
    PhaseCommand command{.gates = Gates::kEdges};
    for (std::size_t k = 0; k < 3; ++k)
      if (level[k] != kOff) command.edges[k] = list({{0, level[k]}});
    const Powers first = powers(level);
    axis_.advance(command, tick_++);
    const Powers middle = powers(level);
    axis_.advance(command, tick_++);
    const Powers last = powers(level);
    const auto add = [&](double& sum, double Powers::*power) {
      sum += kPart_s / 3.0 * (first.*power + 4.0 * middle.*power + last.*power);
    };
    add(from_link_j_, &Powers::from_link_w);
    add(turned_j_, &Powers::turned_w);
    add(copper_j_, &Powers::copper_w);
    add(bridge_j_, &Powers::bridge_w);
    add(shaft_j_, &Powers::shaft_w);
  }

  /// What is missing of the energy of the link, as a part of all that has flown.
  double residue() const {
    return (from_link_j_ - copper_j_ - bridge_j_ - shaft_j_ - stored() - stored_j_) / turned_j_;
  }
  double bridge_part() const { return bridge_j_ / turned_j_; }

 private:
  struct Powers {
    double from_link_w = 0.0;
    double turned_w = 0.0;
    double copper_w = 0.0;
    double bridge_w = 0.0;
    double shaft_w = 0.0;
  };

  PmMachineState machine() const {
    return {.i_a_a = axis_.state().machine[0], .i_b_a = axis_.state().machine[1]};
  }
  RotorMotion motion() const {
    const ShaftState x{axis_.state().shaft.speed_rad_s, axis_.state().shaft.angle_rad};
    const double electrical_rad = c_.pole_pairs * x.angle_rad;
    return {x.angle_rad, x.speed_rad_s, {std::cos(electrical_rad), std::sin(electrical_rad)}};
  }
  double stored() const { return stored_energy_j(c_, machine(), motion()); }

  Powers powers(const std::array<LegLevel, 3>& level) const {
    const InverterParameters& inverter = p_.drive.inverter;
    const std::array<double, 3> i = currents(axis_);
    Powers w{.copper_w = losses_w(c_, machine(), motion()),
             .shaft_w = torque_nm(c_, machine(), motion()) * motion().speed_rad_s};
    for (std::size_t k = 0; k < 3; ++k) {
      const bool high = level[k] == kHigh || (level[k] == kOff && i[k] < 0.0);
      if (high) w.from_link_w += kLink_v * i[k];
      if (high) w.turned_w += kLink_v * std::abs(i[k]);
      w.bridge_w += level[k] == kOff ? inverter.diode_v * std::abs(i[k]) : inverter.switch_ohm * i[k] * i[k];
    }
    return w;
  }

  AxisParameters p_;
  PmMachineConstants c_;
  Axis axis_;
  Tick tick_ = 0;
  double stored_j_ = 0.0;
  double from_link_j_ = 0.0;
  double turned_j_ = 0.0;
  double copper_j_ = 0.0;
  double bridge_j_ = 0.0;
  double shaft_j_ = 0.0;
};

// A centred PWM period of 50 us with dead times of 1 us: what the link gives goes into copper, switches and
// diodes, the shaft and the field of the windings, below 1e-9 of all that has flown. Catches: a diode on the
// wrong rail, a terminal whose drop the link does not give, a machine that gets another voltage than the
// bridge has, an energy that vanishes at an edge.
TEST(Switches, TheEnergyOfAPwmPeriodIsThereToTheLastPart) {
  struct Case {
    double switch_ohm;
    double diode_v;
  };
  for (const Case& bridge : {Case{0.0, 0.0}, Case{8e-3, 0.0}, Case{0.0, 0.9}, Case{8e-3, 0.9}}) {
    for (const double current_a : {18.0, -18.0}) {
      AxisParameters p = standing_motor();
      p.mechanics = {.inertia_kgm2 = 1e-5};
      p.drive.inverter.switch_ohm = bridge.switch_ohm;
      p.drive.inverter.diode_v = bridge.diode_v;
      Balance balance(p);
      balance.start(current_a, 400.0);
      constexpr std::array<int, 3> kHalfWidths{38, 22, 31};  // of the upper switch, of 100 parts, in pairs
      for (int pair = 0; pair < 100; ++pair) {
        std::array<LegLevel, 3> level{};
        for (std::size_t k = 0; k < 3; ++k) {
          const int beyond = std::abs(2 * pair + 1 - 100) / 2 - kHalfWidths[k];  // of the middle of the pulse
          level[k] = beyond < -1 ? kHigh : beyond > 0 ? kLow : kOff;
        }
        balance.pass(level);
      }
      EXPECT_NEAR(balance.residue(), 0.0, 1e-9) << bridge.switch_ohm << " " << bridge.diode_v;
      EXPECT_EQ(balance.bridge_part() > 1e-3, bridge.switch_ohm > 0.0 || bridge.diode_v > 0.0);
    }
  }
}

// A link with a capacitor gives the energy of the rails, and switches and diodes turn their part of it into
// heat. C (v0^2 - v^2)/2 is V times the charge of the upper rail, to the trapezoids of the currents. Catches:
// a link that gives the power of the terminals.
TEST(Switches, TheLinkGivesWhatSwitchesAndDiodesTake) {
  AxisParameters p = standing_motor();
  p.drive.inverter.switch_ohm = 20e-3;
  p.drive.inverter.diode_v = 1.0;
  p.drive.bus = {.voltage_v = kLink_v, .resistance_ohm = 1e6, .capacitance_f = 1.0, .battery = true};
  const auto given_j = [](const Axis& axis) {
    const double v = axis.state().drive.bus_v;
    return 0.5 * (kLink_v - v) * (kLink_v + v);
  };
  Axis driven(p, kTiming, 1, 0);
  const double total_ohm = kResistance_ohm + 20e-3;
  driven.advance(legs(kStaysHigh, kStaysLow), 0);
  const double charge_as =
      0.5 * kLink_v / total_ohm *
      (kTick_s - kInductance_h / total_ohm * (1.0 - std::exp(-kTick_s * total_ohm / kInductance_h)));
  EXPECT_NEAR(given_j(driven), kLink_v * charge_as, 2e-4 * kLink_v * charge_as);
  Axis braking(p, kTiming, 1, 0);
  set_line_current(braking, 30.0);
  braking.advance(kAllOff, 0);  // into the upper rail through the diode of b
  const double against_a = (0.5 * kLink_v + 1.0) / kResistance_ohm;
  const double back_as =
      (30.0 + against_a) * kTime_s * (1.0 - std::exp(-kTick_s / kTime_s)) - against_a * kTick_s;
  EXPECT_NEAR(given_j(braking), -kLink_v * back_as, 2e-4 * kLink_v * back_as);
}

// Catches: losses of a bridge that has no switches, or that two machines share.
TEST(Switches, TheRulesNameTheKindOfDrive) {
  AxisParameters p = standing_motor();
  p.drive.inverter.switch_ohm = 1e-3;
  p.drive.inverter.diode_v = 0.5;
  EXPECT_TRUE(problems(p).empty());
  p.drive.kind = DriveKind::kAveraged;
  std::vector<Problem> found = problems(p);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0].field, "inverter.switch_ohm");
  EXPECT_EQ(found[0].rule, "is 0.001 but must be 0 unless drive.kind is \"switched_inverter\"");
  EXPECT_EQ(found[1].field, "inverter.diode_v");
}

}  // namespace
}  // namespace drivebench::switches_test
