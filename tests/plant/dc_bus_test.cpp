#include "plant/drive/supply/dc_bus.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string_view>
#include <vector>

#include "plant/axis.hpp"
#include "plant/parameters/parameters.hpp"
#include "tests/plant/drive_rig.hpp"
#include "tests/plant/servo_axis.hpp"

namespace drivebench::dc_bus_test {
namespace {

constexpr BusParameters kBus{.voltage_v = 300.0,
                             .resistance_ohm = 0.5,
                             .capacitance_f = 1e-3,
                             .chopper_on_v = 400.0,
                             .chopper_off_v = 380.0,
                             .chopper_ohm = 50.0};

double stored_j(double bus_v) {
  return 0.5 * kBus.capacitance_f * bus_v * bus_v;
}

// Catches: a star whose rails are at the whole link, a default link that does not suit the amplifier.
TEST(DcBus, TheLinkIsThatOfTheAmplifierUnlessItIsGiven) {
  BusParameters p;
  EXPECT_EQ(rail_voltage_v(supply_voltage_v(p, 80.0, Connection::kTwoPhase), Connection::kTwoPhase), 80.0);
  EXPECT_EQ(supply_voltage_v(p, 80.0, Connection::kStar), 160.0);
  EXPECT_EQ(rail_voltage_v(160.0, Connection::kStar), 80.0);
  p.voltage_v = 300.0;
  EXPECT_EQ(supply_voltage_v(p, 80.0, Connection::kStar), 300.0);
}

// Against the closed form of a constant current. Catches: a mean or an end that turns back where a step is
// long for the link.
TEST(DcBus, AForeseenLinkGoesTowardsItsRestAndNoFurther) {
  BusParameters p = kBus;
  p.battery = true;
  constexpr double kBefore_v = 310.0;
  constexpr double kTaken_a = 20.0;
  const double rest_v = p.voltage_v - p.resistance_ohm * kTaken_a;
  const double way_v = kBefore_v - rest_v;
  for (const double x : {1e-6, 0.01, 0.3, 1.0, 1.9, 2.1, 5.0, 50.0}) {
    const double duration_s = x * p.resistance_ohm * p.capacitance_f;
    const ForeseenLink link = foreseen_link(p, p.voltage_v, kBefore_v, false, kTaken_a, duration_s);
    EXPECT_NEAR((link.end_v - rest_v) / way_v, std::exp(-x), 1e-13) << x;
    EXPECT_NEAR((link.mean_v - rest_v) / way_v, -std::expm1(-x) / x, std::pow(x, 4) / 720.0 + 1e-9) << x;
    EXPECT_LE(std::abs(link.end_v - rest_v), std::abs(way_v)) << x;
  }
}

// Random loads and intervals; the balance closes to rounding, whatever the load does. The supply never takes
// energy back. Catches: energy of one part that is not that of the others, a diode the wrong way round, a
// brake resistor that gives energy.
TEST(DcBus, NoEnergyIsLost) {
  std::mt19937_64 engine(11);
  std::uniform_real_distribution<double> power(-20e3, 20e3);
  std::uniform_real_distribution<double> duration(0.1e-6, 20e-6);
  for (const double resistance_ohm : {0.5, 0.0}) {
    BusParameters p = kBus;
    p.resistance_ohm = resistance_ohm;
    double bus_v = 300.0;
    double gained_j = 0.0;
    double supplied_j = 0.0;
    double braked_j = 0.0;
    for (int n = 0; n < 100'000; ++n) {
      const double duration_s = duration(engine);
      const double mean_w = n / 5000 % 2 == 0 ? 6e3 : -2.5e3;
      const double taken_j = (mean_w + power(engine)) * duration_s;
      const BusInterval after = bus_after(p, 300.0, bus_v, bus_v > 390.0, taken_j, duration_s);
      EXPECT_GE(after.supplied_j, -1e-12);
      EXPECT_GE(after.braked_j, 0.0);
      gained_j += after.supplied_j - after.braked_j - taken_j;
      supplied_j += after.supplied_j;
      braked_j += after.braked_j;
      bus_v = after.voltage_v;
    }
    // Rounding of 1e5 intervals at 80 J: 1e-14 each at worst.
    EXPECT_NEAR(gained_j, stored_j(bus_v) - stored_j(300.0), 1e-8);
    EXPECT_GT(supplied_j, 2000.0);
    EXPECT_GT(braked_j, 500.0);
  }
}

// A constant load of 6 kW against the same equation in steps a hundred times as fine: the midpoint rule is
// second order. Catches: a supply current of another voltage, a capacitance off by a factor.
TEST(DcBus, TheVoltageFollowsTheCircuit) {
  double coarse_v = 300.0;
  double fine_v = 300.0;
  for (int n = 0; n < 50; ++n) {
    coarse_v = bus_after(kBus, 300.0, coarse_v, n > 25, 6e3 * 20e-6, 20e-6).voltage_v;
    for (int step = 0; step < 100; ++step) {
      const double into_a =
          std::max(300.0 - fine_v, 0.0) / 0.5 - (n > 25 ? fine_v / 50.0 : 0.0) - 6e3 / fine_v;
      fine_v += 0.2e-6 * into_a / 1e-3;
    }
    EXPECT_NEAR(coarse_v, fine_v, 2e-3) << n;
  }
  EXPECT_LT(coarse_v, 293.0);
}

// Catches: a supply that is a voltage source both ways, a sagged supply that pulls the link down.
TEST(DcBus, TheSupplyCannotTakeCurrentBack) {
  const BusInterval pumped = bus_after(kBus, 300.0, 350.0, false, -0.5, 10e-6);
  EXPECT_EQ(pumped.supplied_j, 0.0);
  EXPECT_NEAR(stored_j(pumped.voltage_v), stored_j(350.0) + 0.5, 1e-12);
  const BusInterval sagged = bus_after(kBus, 100.0, 300.0, false, 0.0, 10e-6);
  EXPECT_EQ(sagged.supplied_j, 0.0);
  EXPECT_EQ(sagged.voltage_v, 300.0);
  const BusInterval dead = bus_after(kBus, 0.0, 300.0, false, 0.05, 10e-6);
  EXPECT_EQ(dead.supplied_j, 0.0);
  EXPECT_NEAR(stored_j(dead.voltage_v), stored_j(300.0) - 0.05, 1e-12);
}

// Catches: a square root of a negative number, a link below zero.
TEST(DcBus, AnEmptyLinkStaysAtZero) {
  for (const bool chopper : {false, true}) {
    double bus_v = 20.0;
    for (int n = 0; n < 10; ++n) {
      bus_v = bus_after(kBus, 0.0, bus_v, chopper, 0.15, 10e-6).voltage_v;
      EXPECT_GE(bus_v, 0.0);
      EXPECT_LE(bus_v, 20.0);
    }
    EXPECT_EQ(bus_v, 0.0);
  }
  EXPECT_GT(bus_after(kBus, 300.0, 0.0, false, 0.0, 10e-6).voltage_v, 1.0);  // and charges again
}

// Catches: a chopper without hysteresis, with exchanged levels, or that needs none to be configured.
TEST(DcBus, TheChopperHasHysteresis) {
  EXPECT_FALSE(chopper_after(kBus, 400.0, false));
  EXPECT_TRUE(chopper_after(kBus, 400.1, false));
  EXPECT_TRUE(chopper_after(kBus, 390.0, true));
  EXPECT_FALSE(chopper_after(kBus, 390.0, false));
  EXPECT_TRUE(chopper_after(kBus, 380.0, true));
  EXPECT_FALSE(chopper_after(kBus, 379.9, true));
  EXPECT_FALSE(chopper_after({}, 1e6, true));
}

DriveParameters on_bus(DriveKind kind) {
  DriveParameters p = plain_drive(kind);
  p.amplifier.voltage_limit_v = 250.0;
  p.bus = kBus;
  p.inverter.dead_time_s = 1e-6;
  return p;
}

// A machine that brakes (emf of 200 V against its command) pumps the link up; the chopper comes and goes
// between its levels. Without chopper, the supply blocked, the link gets exactly what the terminals give,
// with the gates on and through the diodes. Catches: rails that do not follow the link, energy of the diodes
// that is lost, a chopper that is not switched by the link.
TEST(DcBus, EnergyFromTheTerminalsChargesTheLink) {
  for (const DriveKind kind : {DriveKind::kVoltage, DriveKind::kAveraged, DriveKind::kSwitched}) {
    DriveRig rig(on_bus(kind), Connection::kIndependent, {.resistance_ohm = 20.0, .inductance_h = 50e-3});
    rig.load.emf_v = {200.0, -200.0, 150.0};
    const PhaseCommand braking = volts(150.0, -150.0, 120.0);
    double highest_v = 0.0;
    bool braked = false;
    bool released = false;
    for (int tick = 0; tick < 2000; ++tick) {
      rig.tick(braking);
      highest_v = std::max(highest_v, rig.memory.bus_v);
      released = released || (braked && rig.memory.chopper == 0.0);
      braked = braked || rig.memory.chopper != 0.0;
      EXPECT_EQ(rig.drive.at(rig.memory, 0.0, 1e-6, {}).rail_v, rig.memory.bus_v);
    }
    EXPECT_LT(rig.energy_j, -10.0);
    EXPECT_TRUE(braked);
    EXPECT_TRUE(released);
    EXPECT_GT(highest_v, 399.0);
    EXPECT_LT(highest_v, 405.0);

    DriveParameters without_chopper = on_bus(kind);
    without_chopper.bus.chopper_on_v = 0.0;
    rig.drive.set_parameters(without_chopper);
    rig.memory.chopper = 0.0;
    for (const PhaseCommand& command : {braking, PhaseCommand{}}) {
      const double before_v = rig.memory.bus_v;
      const double before_j = rig.energy_j;
      for (int tick = 0; tick < 20; ++tick)
        rig.tick(command);
      EXPECT_LT(rig.energy_j - before_j, -0.1);
      EXPECT_NEAR(stored_j(rig.memory.bus_v) - stored_j(before_v), before_j - rig.energy_j, 1e-9);
    }
  }
}

// Catches: an arc that charges the link.
TEST(DcBus, AnArcDoesNotChargeTheLink) {
  DriveParameters p = on_bus(DriveKind::kAveraged);
  DriveRig rig(p, Connection::kTwoPhase);
  rig.memory.bus_v = 350.0;  // the supply is blocked
  rig.current_a = {5.0, 0.0, 0.0};
  rig.tick(volts(0.0), {.open_phase = 1.0});
  EXPECT_LT(rig.current_a[0], 5.0);
  EXPECT_EQ(rig.memory.bus_v, 350.0);
}

// Catches: a chopper on a stiff link, a stiff link that remembers a voltage.
TEST(DcBus, AStiffLinkIsItsSupply) {
  DriveParameters p = on_bus(DriveKind::kAveraged);
  p.bus.capacitance_f = 0.0;
  DriveRig rig(p, Connection::kStar);
  EXPECT_EQ(rig.memory.bus_v, 300.0);
  InjectedFaults faults;
  faults.bus_sag = 0.25;
  rig.tick(volts(10.0), faults);
  EXPECT_EQ(rig.memory.bus_v, 225.0);
  EXPECT_EQ(rig.drive.at(rig.memory, 0.0, 1e-6, {}).rail_v, 112.5);
  rig.tick(volts(10.0));
  EXPECT_EQ(rig.memory.bus_v, 300.0);
}

BusParameters battery() {
  return {.voltage_v = 300.0, .resistance_ohm = 0.05, .capacitance_f = 1e-3, .battery = true};
}

// A link above its battery falls to it with the time constant R C, where a rectifier would leave it. The
// midpoint rule errs by (h/RC)^2/12 of the exponent. Catches: a battery that is a rectifier, a resistance in
// one direction only.
TEST(DcBus, ALinkAboveItsBatteryFallsToIt) {
  double bus_v = 350.0;
  for (int n = 1; n <= 200; ++n) {
    const BusInterval after = bus_after(battery(), 300.0, bus_v, false, 0.0, 1e-6);
    EXPECT_LT(after.supplied_j, 0.0);
    bus_v = after.voltage_v;
    ASSERT_NEAR(bus_v, 300.0 + 50.0 * std::exp(-n * 1e-6 / 50e-6), 1e-3);
  }
}

// With a constant power p the link settles where (U - v) v/R = p, the larger root. Catches: the smaller root,
// a drop of the wrong sign while the machine brakes.
TEST(DcBus, ABatteryCarriesAConstantPowerInBothDirections) {
  for (const double power_w : {6e3, -6e3, 40.0}) {
    double bus_v = 300.0;
    for (int n = 0; n < 2000; ++n)
      bus_v = bus_after(battery(), 300.0, bus_v, false, power_w * 5e-6, 5e-6).voltage_v;
    EXPECT_NEAR(bus_v, 150.0 + std::sqrt(150.0 * 150.0 - 0.05 * power_w), 1e-9) << power_w;
  }
}

// Catches: energy of a battery that is not that of link, brake resistor and terminals; a battery without
// resistance that lets the link go.
TEST(DcBus, ABatteryLosesNoEnergy) {
  std::mt19937_64 engine(12);
  std::uniform_real_distribution<double> power(-20e3, 20e3);
  for (const double resistance_ohm : {0.05, 0.0}) {
    BusParameters p = battery();
    p.resistance_ohm = resistance_ohm;
    p.chopper_ohm = 50.0;
    double bus_v = 300.0;
    double gained_j = 0.0;
    double given_back_j = 0.0;
    for (int n = 0; n < 10'000; ++n) {
      const double taken_j = power(engine) * 5e-6;
      const BusInterval after = bus_after(p, 300.0, bus_v, n > 5000, taken_j, 5e-6);
      gained_j += after.supplied_j - after.braked_j - taken_j;
      given_back_j += std::min(after.supplied_j, 0.0);
      bus_v = after.voltage_v;
      if (resistance_ohm == 0.0) {
        EXPECT_NEAR(bus_v, 300.0, 1e-12);
        EXPECT_EQ(after.braked_j, n > 5000 ? 5e-6 * 300.0 * 300.0 / 50.0 : 0.0);
      }
    }
    EXPECT_NEAR(gained_j, stored_j(bus_v) - stored_j(300.0), 1e-9);
    EXPECT_LT(given_back_j, -10.0);
  }
}

bool is_refused(const AxisParameters& p, std::string_view field) {
  const std::vector<Problem> found = problems(p);
  return std::any_of(found.begin(), found.end(), [&](const Problem& each) { return each.field == field; });
}

// Catches: a battery whose resistance does nothing because the link is stiff; a step that jumps over R C.
TEST(DcBus, ABatteryNeedsACapacitorAndStepsThatFollowIt) {
  AxisParameters p = servo_axis();
  p.drive = plain_drive(DriveKind::kAveraged);
  p.drive.bus = battery();
  p.drive.bus.resistance_ohm = 0.02;
  EXPECT_FALSE(is_refused(p, "bus.battery"));
  EXPECT_EQ(default_substeps(p, kRigTick_s), 10);  // R C = 20 us
  p.drive.bus.capacitance_f = 0.0;
  EXPECT_TRUE(is_refused(p, "bus.battery"));
}

// A machine that brakes gives its energy to the battery: what the terminals give is what the battery takes,
// the losses of its resistance and what the capacitor keeps. Catches: a drive that holds the link where a
// rectifier would.
TEST(DcBus, ABrakingMachineChargesTheBattery) {
  for (const DriveKind kind : {DriveKind::kVoltage, DriveKind::kAveraged, DriveKind::kSwitched}) {
    DriveParameters p = plain_drive(kind);
    p.amplifier.voltage_limit_v = 250.0;
    p.bus = battery();
    p.bus.resistance_ohm = 2.0;
    DriveRig rig(p, Connection::kIndependent, {.resistance_ohm = 20.0, .inductance_h = 50e-3}, 100);
    rig.load.emf_v = {200.0, -200.0, 150.0};
    for (int tick = 0; tick < 500; ++tick)
      rig.tick(volts(150.0, -150.0, 120.0));
    double into_battery_j = 0.0;
    double lost_j = 0.0;
    const double before_j = rig.energy_j;
    const double start_v = rig.memory.bus_v;
    for (int tick = 0; tick < 200; ++tick) {
      const double first_v = rig.memory.bus_v;
      rig.tick(volts(150.0, -150.0, 120.0));
      const double current_a = (0.5 * (first_v + rig.memory.bus_v) - 300.0) / 2.0;
      into_battery_j += kRigTick_s * 300.0 * current_a;
      lost_j += kRigTick_s * 2.0 * current_a * current_a;
    }
    EXPECT_GT(rig.memory.bus_v, 301.0);
    EXPECT_LT(rig.memory.bus_v, 320.0);
    EXPECT_GT(into_battery_j, 1.0);
    // The link is followed from tick to tick here, and ripples within one under a switched inverter.
    EXPECT_NEAR(before_j - rig.energy_j,
                into_battery_j + lost_j + stored_j(rig.memory.bus_v) - stored_j(start_v),
                (kind == DriveKind::kSwitched ? 2e-2 : 1e-4) * into_battery_j);
  }
}

}  // namespace
}  // namespace drivebench::dc_bus_test
