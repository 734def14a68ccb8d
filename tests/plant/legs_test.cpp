// Duties of legs with their common part, legs that are off, and the terminals against the negative rail.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "plant/axis.hpp"
#include "plant/parameters/parameters.hpp"
#include "protocols/signals/catalogue.hpp"
#include "tests/plant/bldc_motor.hpp"
#include "tests/plant/drive_rig.hpp"
#include "tests/plant/servo_axis.hpp"

namespace drivebench::legs_test {
namespace {

constexpr double kLink_v = 300.0;
constexpr double kTick_s = 100e-6;
constexpr double kDead_s = 2e-6;

PhaseCommand duties(double a, double b = 0.0, double c = 0.0, std::uint32_t legs_off = 0) {
  return {.gates = Gates::kDuty, .legs_off = legs_off, .setpoint = {.a = a, .b = b, .c = c}};
}

DriveParameters inverter(DriveKind kind, double dead_time_s = 0.0) {
  DriveParameters p = plain_drive(kind);
  p.amplifier.voltage_limit_v = 0.5 * kLink_v;
  p.amplifier.over_current_a = 1000.0;
  p.bus.voltage_v = kLink_v;
  p.inverter.dead_time_s = dead_time_s;
  return p;
}

/// The motor of BL-05 on an inverter, with its terminals against the negative rail.
AxisParameters bldc_axis(DriveKind kind, double dead_time_s = 0.0) {
  AxisParameters p;
  p.machine = bldc_motor::kMotor;
  p.mechanics = {.inertia_kgm2 = bldc_motor::kInertia_kgm2,
                 .viscous_friction_nms = bldc_motor::kFriction_nms};
  p.drive = inverter(kind, dead_time_s);
  p.sensors.terminals = true;
  return p;
}

Axis axis_of(const AxisParameters& p) {
  return Axis(p, {.period_s = kTick_s, .substeps = 4}, 1, 0);
}

std::array<double, 3> terminals(const Sample& s) {
  return {s.terminal_a_v, s.terminal_b_v, s.terminal_c_v};
}
std::array<double, 3> terminal_means(const Sample& s) {
  return {s.terminal_a_mean_v, s.terminal_b_mean_v, s.terminal_c_mean_v};
}
std::array<double, 3> currents(const Sample& s) {
  return {s.true_i_a_a, s.true_i_b_a, s.true_i_c_a};
}

// Duties 0, 0.5 and 1 on all legs: no current flows, and the terminals are at the lower rail, half way and at
// the upper one. Catches: a common part that the injection of the inverter takes away, a duty that counts
// from the middle of the link.
TEST(Legs, TheCommonPartOfDutiesReachesTheTerminals) {
  for (const DriveKind kind : {DriveKind::kVoltage, DriveKind::kAveraged, DriveKind::kSwitched}) {
    for (const double duty : {0.0, 0.5, 1.0}) {
      Axis axis = axis_of(bldc_axis(kind));
      for (Tick tick = 0; tick < 3; ++tick)
        axis.advance(duties(duty, duty, duty), tick);
      const Sample s = axis.sample(3);
      for (const double mean_v : terminal_means(s))
        EXPECT_NEAR(mean_v, duty * kLink_v, 1e-10);
      for (const double i : currents(s))
        EXPECT_NEAR(i, 0.0, 1e-12);
      EXPECT_EQ(s.faults, 0u);
      // A leg starts its carrier period at the lower rail, unless it stays at the upper one.
      if (kind == DriveKind::kSwitched) {
        EXPECT_EQ(s.terminal_a_v, duty == 1.0 ? kLink_v : 0.0);
      }
    }
  }
}

// Volt-seconds of each leg: d V T, less the dead time's V t_dead against the direction of the current; none
// where a leg is clamped to a rail. Catches: a dead time that is taken from the duty, an error with the wrong
// sign, a clamped leg that switches.
TEST(Legs, ALegGivesItsDutyLessTheDeadTime) {
  struct Case {
    double duty;
    double current_a;
    double lost_v;
  };
  const double lost_v = kLink_v * kDead_s / kRigTick_s;
  for (const Case& c : {Case{0.3, 5.0, lost_v}, Case{0.3, -5.0, -lost_v}, Case{0.8, 5.0, lost_v},
                        Case{0.0, 5.0, 0.0}, Case{1.0, -5.0, 0.0}, Case{1.0, 5.0, 0.0}}) {
    // A large inductance keeps the currents and their signs.
    DriveRig rig(inverter(DriveKind::kSwitched, kDead_s), Connection::kStar, {.inductance_h = 1e3});
    rig.current_a = {c.current_a, -0.5 * c.current_a, -0.5 * c.current_a};
    rig.tick(duties(c.duty, 0.5, 0.5));
    const double mean_v = rig.volt_seconds[0] / kRigTick_s + 0.5 * kLink_v;
    EXPECT_NEAR(mean_v, c.duty * kLink_v - c.lost_v, 1e-9) << c.duty << " " << c.current_a;
  }
}

// Catches: a winding between two legs that gets a leg's duty, a field that gets none, an amplifier that
// counts from the negative rail.
TEST(Legs, AWindingBetweenTwoLegsHasDutiesOfBothSigns) {
  for (const DriveKind kind : {DriveKind::kAveraged, DriveKind::kSwitched}) {
    DriveRig rig(inverter(kind), Connection::kTwoPhase, {.inductance_h = 1e3});
    rig.tick({.gates = Gates::kDuty, .setpoint = {.a = 0.25, .b = -0.5, .field = 0.125}});
    EXPECT_NEAR(rig.volt_seconds[0] / kRigTick_s, 0.25 * kLink_v, 1e-9);
    EXPECT_NEAR(rig.volt_seconds[1] / kRigTick_s, -0.5 * kLink_v, 1e-9);
    EXPECT_EQ(rig.drive.at(rig.memory, 0.0, 1e-6, {}).field_v, 0.125 * kLink_v);
  }
  DriveRig linear(inverter(DriveKind::kVoltage), Connection::kStar);
  linear.drive.begin_tick(linear.memory, duties(0.75, 0.5, 0.25), {}, 0);
  const TerminalDrive out = linear.drive.at(linear.memory, 0.0, 1e-6, {});
  EXPECT_EQ(out.start_v.a, 0.25 * kLink_v);
  EXPECT_EQ(out.start_v.b, 0.0);
  EXPECT_EQ(out.start_v.c, -0.25 * kLink_v);
}

// Catches: a duty beyond a rail that wraps around, shortens the others like a vector or leaves no flag.
TEST(Legs, ADutyBeyondTheRailsIsLimitedAloneAndFlagged) {
  for (const DriveKind kind : {DriveKind::kAveraged, DriveKind::kSwitched}) {
    Axis axis = axis_of(bldc_axis(kind));
    AxisState state = axis.state();
    axis.advance(duties(1.5, 0.25, -0.5), 0);
    const Sample s = axis.sample(1);
    EXPECT_EQ(s.faults & kVoltageSaturated, kVoltageSaturated);
    EXPECT_NEAR(s.terminal_a_mean_v, kLink_v, 1e-9);
    EXPECT_NEAR(s.terminal_b_mean_v, 0.25 * kLink_v, 1e-9);
    EXPECT_NEAR(s.terminal_c_mean_v, 0.0, 1e-9);
    axis.restore(state);
    axis.advance(duties(1.0, 0.25, 0.0), 0);
    EXPECT_EQ(axis.sample(1).faults & kVoltageSaturated, 0u);
  }
}

// The command's duties follow a link that moves within the tick. Catches: duties that became volts at the
// start of the tick.
TEST(Legs, TheVoltageOfADutyFollowsTheLink) {
  DriveParameters p = inverter(DriveKind::kAveraged);
  p.bus.capacitance_f = 1e-3;
  DriveRig rig(p, Connection::kTwoPhase);
  rig.drive.begin_tick(rig.memory, duties(0.5), {}, 0);
  rig.memory.bus_v = 350.0;
  EXPECT_EQ(rig.drive.at(rig.memory, 0.0, 1e-6, {}).start_v.a, 175.0);
}

// A leg that is off is a leg whose driver failed: the same bits, and in a switched inverter the same to the
// error of a step, which the edges of the failed driver still divide. Catches: a mask that is shifted, a
// switched leg that goes on switching, a leg off that stops the others.
TEST(Legs, ALegThatIsOffIsThatOfAFailedDriver) {
  for (const DriveKind kind : {DriveKind::kVoltage, DriveKind::kAveraged, DriveKind::kSwitched}) {
    for (std::uint32_t leg = 0; leg < 3; ++leg) {
      Axis off = axis_of(bldc_axis(kind, 1e-6));
      Axis failed = axis_of(bldc_axis(kind, 1e-6));
      const PhaseCommand all_on = duties(0.6, 0.45, 0.5);
      PhaseCommand one_off = all_on;
      one_off.legs_off = 1u << leg;
      for (Tick tick = 0; tick < 200; ++tick) {
        const bool now = tick >= 60 && tick < 140;
        off.advance(now ? one_off : all_on, tick);
        failed.inject(find_injectable_fault("leg_stuck_off"), now ? leg + 1.0 : 0.0);
        failed.advance(all_on, tick);
        Sample a = off.sample(tick + 1);
        Sample b = failed.sample(tick + 1);
        a.injected = b.injected = 0;
        const double tolerance = kind == DriveKind::kSwitched ? 1e-5 : 0.0;
        for (const Signal& signal : kSignals) {
          ASSERT_NEAR(value_of(signal, a), value_of(signal, b), tolerance) << signal.name << " " << tick;
        }
        // In a carrier's valley, with the other legs at the lower rail, the emf may open a diode of the leg.
        if (now && tick > 130 && kind != DriveKind::kSwitched) {
          EXPECT_EQ(currents(a)[leg], 0.0);
        }
      }
    }
  }
}

// Catches: a mask that gates off, zero voltage or an amplifier pass over, legs that a machine lacks, an
// integral of the current loop that winds up while its leg is off.
TEST(Legs, TheMaskHoldsWithEveryKindOfGates) {
  DriveParameters p = inverter(DriveKind::kCurrent);
  p.current_loop = {.proportional_v_per_a = 1.0, .integral_v_per_as = 1e4, .limit_a = 10.0};
  for (const Gates gates :
       {Gates::kOff, Gates::kVoltage, Gates::kZeroVoltage, Gates::kCurrent, Gates::kDuty}) {
    DriveRig rig(p, Connection::kTwoPhase);
    rig.tick({.gates = gates, .legs_off = 2 + 4, .setpoint = {.a = 0.5, .b = 0.5}});
    const TerminalDrive out = rig.drive.at(rig.memory, 0.0, 1e-6, {});
    EXPECT_EQ(out.mode[0], gates == Gates::kOff ? TerminalMode::kDiodes : TerminalMode::kDriven);
    EXPECT_EQ(out.mode[1], TerminalMode::kDiodes);
    EXPECT_EQ(rig.memory.integral_v.b, 0.0);
    EXPECT_EQ(rig.memory.integral_v.a != 0.0, gates == Gates::kCurrent);
  }
}

/// The legs of six-step commutation: the electrical angle that the sector begins at, the leg towards the
/// upper rail, the leg towards the lower one. The emf of the book has the sense of the terminal voltage: the
/// current flows into the phase on the negative top.
struct Sector {
  std::size_t high;
  std::size_t low;
  std::size_t off() const { return 3 - high - low; }
};

Sector sector_at(double electrical_rad) {
  std::array<double, 3> e{};
  for (std::size_t k = 0; k < 3; ++k)
    e[k] = bldc_motor::book_shape(electrical_rad - static_cast<double>(k) * 2.0 * std::numbers::pi / 3.0);
  const auto high = std::min_element(e.begin(), e.end()) - e.begin();
  const auto low = std::max_element(e.begin(), e.end()) - e.begin();
  return {.high = static_cast<std::size_t>(high), .low = static_cast<std::size_t>(low)};
}

PhaseCommand six_step(const Sector& sector, double duty) {
  std::array<double, 3> d{};
  d[sector.high] = 0.5 + 0.5 * duty;
  d[sector.low] = 0.5 - 0.5 * duty;
  return duties(d[0], d[1], d[2], 1u << sector.off());
}

/// The floating phase f between the driven ones p, q by hand. These carry opposite currents, so that the sum
/// of their equations u - v_N = R i + L i' - E leaves v_N = (v_p + v_q + E_p + E_q)/2, and v_f = v_N - E_f.
double floating_v(const Sector& sector, const std::array<double, 3>& terminal_v, double angle_rad,
                  double speed_rad_s) {
  std::array<double, 3> emf_v{};
  for (std::size_t k = 0; k < 3; ++k) {
    emf_v[k] = bldc_motor::kMotor.torque_constant_nm_per_a * speed_rad_s *
               bldc_motor::book_shape(angle_rad - static_cast<double>(k) * 2.0 * std::numbers::pi / 3.0);
  }
  const double neutral_v =
      0.5 * (terminal_v[sector.high] + terminal_v[sector.low] + emf_v[sector.high] + emf_v[sector.low]);
  return neutral_v - emf_v[sector.off()];
}

// The motor runs up on six-step commutation by its angle. In all six sectors the phase that is off lets its
// current die in a diode and then stands where emf and neutral put it. Catches: a floating terminal at the
// middle of the link, an emf of the wrong sign or of another phase, a leg that stays driven, a neutral that
// counts the floating phase.
TEST(Legs, SixStepCommutationFloatsTheThirdPhaseInEverySector) {
  constexpr Tick kTicks = 8000;
  for (const DriveKind kind : {DriveKind::kAveraged, DriveKind::kSwitched}) {
    Axis axis(bldc_axis(kind), {.period_s = 20e-6, .substeps = 1}, 1, 0);
    axis.set_load(5.0, 0, 0);                                      // 4.9 A, which take some ticks to die
    const double duty = kind == DriveKind::kSwitched ? 1.0 : 0.4;  // 1: no edges but commutation
    std::array<int, 9> floats{};
    std::array<int, 9> dies{};
    for (Tick tick = 0; tick < kTicks; ++tick) {
      const Sector sector = sector_at(axis.state().shaft.angle_rad);
      axis.advance(six_step(sector, duty), tick);
      const Sample s = axis.sample(tick + 1);
      ASSERT_EQ(s.faults, 0u);
      const std::array<double, 3> v = terminals(s);
      const std::size_t number = 3 * sector.high + sector.low;
      EXPECT_NEAR(v[sector.high], (0.5 + 0.5 * duty) * kLink_v, 1e-9);
      EXPECT_NEAR(v[sector.low], (0.5 - 0.5 * duty) * kLink_v, 1e-9);
      if (currents(s)[sector.off()] != 0.0) {
        ++dies[number];
        EXPECT_EQ(v[sector.off()], currents(s)[sector.off()] > 0.0 ? 0.0 : kLink_v);
        continue;
      }
      ++floats[number];
      const double angle_rad = axis.state().shaft.angle_rad;
      // Beyond a rail its diode conducts again.
      const double open_v = floating_v(sector, v, angle_rad, s.speed_rad_s);
      EXPECT_NEAR(v[sector.off()], std::clamp(open_v, 0.0, kLink_v), 1e-9);
    }
    EXPECT_EQ(std::count_if(floats.begin(), floats.end(), [](int n) { return n > 20; }), 6);
    EXPECT_EQ(std::count_if(dies.begin(), dies.end(), [](int n) { return n > 0; }), 6);
    EXPECT_GT(axis.sample(kTicks).speed_rad_s, 80.0);
  }
}

// At a steady speed the mean of a floating terminal is the closed form in the middle of the tick: the emf
// goes linearly but for its corners. Catches: a mean that keeps the value at the start of its pieces, or that
// takes the voltage after an event for the piece before it.
TEST(Legs, TheMeanOfAFloatingTerminalIsThatOfItsWay) {
  AxisParameters p = bldc_axis(DriveKind::kAveraged);
  p.mechanics.motion = ShaftMotion::kImposed;
  p.mechanics.imposed_speed_rad_s = 100.0;
  Axis axis = axis_of(p);
  int compared = 0;
  Sector before{.high = 0, .low = 1};
  bool floated = false;
  for (Tick tick = 0; tick < 2000; ++tick) {
    const double start_rad = axis.state().shaft.angle_rad;
    const Sector sector = sector_at(start_rad);
    axis.advance(six_step(sector, 0.4), tick);
    const Sample s = axis.sample(tick + 1);
    const double speed_rad_s = axis.state().shaft.speed_rad_s;
    const bool floats = currents(s)[sector.off()] == 0.0;
    const bool settled = floats && floated && sector.off() == before.off();
    before = sector;
    floated = floats;
    if (!settled) continue;
    const double middle_rad = start_rad + 0.5 * kTick_s * speed_rad_s;
    const auto corners = [](double rad) { return std::floor(rad * 3.0 / std::numbers::pi - 0.5); };
    if (corners(start_rad) != corners(start_rad + kTick_s * speed_rad_s)) continue;
    ++compared;
    const double expected_v = floating_v(sector, terminal_means(s), middle_rad, speed_rad_s);
    EXPECT_NEAR(terminal_means(s)[sector.off()], expected_v, 1e-6) << tick;
  }
  EXPECT_GT(compared, 1000);
}

// All legs off at speed below the link: no terminal conducts, and the star floats about the middle of the
// link. Beyond the link two diodes conduct and the terminals are within the rails. Catches: terminals beyond
// the rails, an open star against a rail.
TEST(Legs, AnOpenStarFloatsAboutTheMiddleAndItsDiodesHoldItWithinTheRails) {
  AxisParameters p = bldc_axis(DriveKind::kSwitched);
  p.mechanics.motion = ShaftMotion::kImposed;
  for (const double speed_rad_s : {200.0, 500.0}) {
    p.mechanics.imposed_speed_rad_s = speed_rad_s;
    Axis axis(p, {.period_s = kTick_s, .substeps = 64}, 1, 0);
    double lowest_v = kLink_v;
    double highest_v = 0.0;
    bool flows = false;
    for (Tick tick = 0; tick < 1000; ++tick) {
      axis.advance(duties(0.5, 0.5, 0.5, kAllLegs), tick);
      const Sample s = axis.sample(tick + 1);
      for (const double v : terminals(s)) {
        lowest_v = std::min(lowest_v, v);
        highest_v = std::max(highest_v, v);
      }
      flows = flows || s.true_i_a_a != 0.0;
    }
    const double top_v = bldc_motor::kMotor.torque_constant_nm_per_a * speed_rad_s;
    EXPECT_EQ(flows, 2.0 * top_v > kLink_v);
    // The emfs of a trapezoid do not add to zero: a third of the phase in between belongs to the neutral. A
    // diode begins to conduct with a substep, in which the emf moves by 0.4 V.
    const double most_v = std::min(0.5 * kLink_v + 4.0 / 3.0 * top_v, kLink_v);
    EXPECT_NEAR(highest_v, most_v, 0.5);
    EXPECT_NEAR(lowest_v, kLink_v - most_v, 0.5);
  }
}

// One leg alone carries no current, but it holds its terminal; the others stand at emf differences from it,
// above the lower rail here. Catches: a star that floats about the middle although a leg is on.
TEST(Legs, OneLegThatIsOnHoldsTheWholeStar) {
  AxisParameters p = bldc_axis(DriveKind::kAveraged);
  p.mechanics.motion = ShaftMotion::kImposed;
  p.mechanics.imposed_speed_rad_s = 50.0;
  Axis axis = axis_of(p);
  for (Tick tick = 0; tick < 500; ++tick) {
    axis.advance(duties(0.4, 0.5, 0.5, 2 + 4), tick);
    const Sample s = axis.sample(tick + 1);
    const auto emf_v = [&](double k) {
      return bldc_motor::kMotor.torque_constant_nm_per_a * axis.state().shaft.speed_rad_s *
             bldc_motor::book_shape(axis.state().shaft.angle_rad - k * 2.0 * std::numbers::pi / 3.0);
    };
    ASSERT_NEAR(s.terminal_a_v, 0.4 * kLink_v, 1e-9);
    ASSERT_NEAR(s.terminal_b_v, 0.4 * kLink_v + emf_v(0.0) - emf_v(1.0), 1e-9);
    ASSERT_NEAR(s.terminal_c_v, 0.4 * kLink_v + emf_v(0.0) - emf_v(2.0), 1e-9);
    ASSERT_NEAR(s.terminal_a_mean_v, 0.4 * kLink_v, 1e-9);
    ASSERT_EQ(currents(s), (std::array<double, 3>{}));
  }
}

// Catches: a channel that costs every bench its smooth ticks, or shows values where it is off.
TEST(Legs, TerminalsAreShownWhereTheyAreConfigured) {
  AxisParameters p = bldc_axis(DriveKind::kAveraged);
  p.sensors.terminals = false;
  Axis axis = axis_of(p);
  axis.advance(duties(0.5, 0.4, 0.5), 0);
  const Sample s = axis.sample(1);
  for (const double v : terminals(s))
    EXPECT_EQ(v, 0.0);
  for (const double v : terminal_means(s))
    EXPECT_EQ(v, 0.0);
}

// Catches: rails that a source does not have.
TEST(Legs, ASourceHasNoRails) {
  AxisParameters p = bldc_axis(DriveKind::kSource);
  const auto is_refused = [&p] {
    const std::vector<Problem> found = problems(p);
    return std::any_of(found.begin(), found.end(),
                       [](const Problem& each) { return each.field == "voltage_sensor.against_rail"; });
  };
  EXPECT_TRUE(is_refused());
  p.sensors.terminals = false;
  EXPECT_FALSE(is_refused());
}

// The voltages of a bridge's first leg, and zero for terminals that the machine lacks. Catches: the voltage
// across the winding in place of the leg's.
TEST(Legs, AWindingBetweenTwoLegsShowsItsFirstLeg) {
  AxisParameters p = servo_axis();
  p.drive = inverter(DriveKind::kSwitched);
  p.sensors.terminals = true;
  Axis axis(p, kServoTiming, 1, 0);
  axis.advance(duties(0.25, -0.5), 0);
  const Sample s = axis.sample(1);
  EXPECT_NEAR(s.terminal_a_mean_v, (0.5 + 0.125) * kLink_v, 1e-9);
  EXPECT_NEAR(s.terminal_b_mean_v, (0.5 - 0.25) * kLink_v, 1e-9);
  EXPECT_EQ(s.terminal_a_v, 0.0);
  EXPECT_EQ(s.terminal_c_v, 0.0);
  EXPECT_EQ(s.terminal_c_mean_v, 0.0);
}

}  // namespace
}  // namespace drivebench::legs_test
