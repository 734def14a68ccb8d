#include "plant/drive/dc_bus.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "tests/plant/drive_rig.hpp"

namespace drivebench {
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

}  // namespace
}  // namespace drivebench
