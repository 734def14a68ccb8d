#include "plant/drive/terminals.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace drivebench::terminals_test {
namespace {

constexpr double kRail_v = 100.0;

TerminalDrive driven(double a, double b, double c) {
  return {.start_v = {a, b, c}, .rail_v = kRail_v};
}

TerminalDrive gates_off() {
  return {.mode = {TerminalMode::kDiodes, TerminalMode::kDiodes, TerminalMode::kDiodes}, .rail_v = kRail_v};
}

/// A winding vector with these three phase values.
WindingValues star_values(double a, double b, double c) {
  return {.stator = three_to_two({a, b, c})};
}

/// connect() with a machine whose open windings have these voltages whatever the others do.
TerminalCircuit connected(Connection connection, const TerminalDrive& drive, const InjectedFaults& faults,
                          const PhaseValues& current_a, const WindingValues& emf_v, TerminalSet& open) {
  const auto ask = [&emf_v](const TerminalInput&) noexcept { return emf_v; };
  return connect(connection, drive, faults, current_a, WindingVoltagesOf(ask), open);
}

// Catches: a common voltage of the terminals that reaches the windings of a star.
TEST(Terminals, ACommonVoltageDoesNothingToAStar) {
  TerminalSet open = 0;
  const TerminalCircuit x = connected(Connection::kStar, driven(60.0, -20.0, -40.0), {}, {}, {}, open);
  const TerminalCircuit y = connected(Connection::kStar, driven(90.0, 10.0, -10.0), {}, {}, {}, open);
  EXPECT_NEAR(x.start.voltage_v.a, y.start.voltage_v.a, 1e-12);
  EXPECT_NEAR(x.start.voltage_v.b, y.start.voltage_v.b, 1e-12);
  EXPECT_EQ(x.start.conduction, Conduction::kFull);
  EXPECT_EQ(y.start_v.a, 90.0);
}

// The voltage of a line is that between its two terminals, over sqrt(2). Catches: a line with the wrong sign
// or between the wrong phases, a floating terminal that still has a say.
TEST(Terminals, AnOpenPhaseLeavesTheLineBetweenTheOtherTwo) {
  constexpr double kV[3] = {50.0, -30.0, 10.0};
  for (int k = 0; k < 3; ++k) {
    TerminalDrive drive = driven(kV[0], kV[1], kV[2]);
    drive.mode[static_cast<std::size_t>(k)] = TerminalMode::kOpen;
    TerminalSet open = 0;
    const TerminalCircuit circuit = connected(Connection::kStar, drive, {}, {}, {}, open);
    EXPECT_EQ(open, TerminalSet{1} << k);
    ASSERT_EQ(circuit.start.conduction, Conduction::kLine);
    const TerminalInput& u = circuit.start;
    const double along = u.line.a * u.voltage_v.a + u.line.b * u.voltage_v.b;
    EXPECT_NEAR(along, (kV[(k + 1) % 3] - kV[(k + 2) % 3]) / std::sqrt(2.0), 1e-12) << k;
    EXPECT_NEAR(u.line.a * u.line.a + u.line.b * u.line.b, 1.0, 1e-15);
    // A current along the line leaves terminal k without current.
    const ThreePhase i = two_to_three(u.line);
    const double of_k = k == 0 ? i.a : (k == 1 ? i.b : i.c);
    EXPECT_NEAR(of_k, 0.0, 1e-15);
  }
}

// Catches: diodes that feed the machine, a phase forgotten.
TEST(Terminals, CurrentsFlowThroughTheDiodesAgainstTheRails) {
  TerminalSet open = 0;
  const PhaseValues current{.a = 3.0, .b = -2.0, .c = -1.0};
  const TerminalCircuit circuit = connected(Connection::kStar, gates_off(), {}, current, {}, open);
  EXPECT_EQ(circuit.start_v.a, -kRail_v);
  EXPECT_EQ(circuit.start_v.b, kRail_v);
  EXPECT_EQ(circuit.start_v.c, kRail_v);
  EXPECT_EQ(circuit.dying, 7u);
  EXPECT_EQ(open, 0u);
}

// The emf between two terminals must exceed the whole link. Catches: a rectifier that compares with half of
// it, that takes the wrong pair, or that never starts.
TEST(Terminals, AStarRectifiesOnceTheEmfBetweenTwoTerminalsExceedsTheLink) {
  for (const double peak : {99.0, 101.0}) {
    TerminalSet open = 7;
    const WindingValues emf = star_values(peak, -peak, 0.0);
    const TerminalCircuit circuit = connected(Connection::kStar, gates_off(), {}, {}, emf, open);
    if (peak < kRail_v) {
      EXPECT_EQ(open, 7u);
      EXPECT_EQ(circuit.start.conduction, Conduction::kNone);
      EXPECT_NEAR(circuit.start_v.a, peak, 1e-12);
    } else {
      EXPECT_EQ(open, 4u);
      EXPECT_EQ(circuit.start_v.a, kRail_v);
      EXPECT_EQ(circuit.start_v.b, -kRail_v);
    }
  }
}

// With a and b in series across the link the third terminal sits at its emf above the neutral. Catches: a
// third diode that conducts too early or never.
TEST(Terminals, TheThirdDiodeOfAStarConductsWhenItsTerminalPassesARail) {
  for (const double emf_c : {90.0, 120.0}) {
    TerminalSet open = 4;
    const PhaseValues current{.a = 2.0, .b = -2.0};
    const WindingValues emf = star_values(-emf_c / 2, -emf_c / 2, emf_c);
    const TerminalCircuit circuit = connected(Connection::kStar, gates_off(), {}, current, emf, open);
    // The neutral is at the mean of (-100 + emf_c/2) and (100 + emf_c/2).
    const bool conducts = 1.5 * emf_c > kRail_v;
    EXPECT_EQ(open, conducts ? 0u : 4u) << emf_c;
    EXPECT_NEAR(circuit.start_v.c, conducts ? kRail_v : 1.5 * emf_c, 1e-12);
  }
}

// Catches: a short that leaves a voltage between its terminals, or one that the circuit does not report.
TEST(Terminals, AShortPutsBothTerminalsAtOneVoltage) {
  InjectedFaults faults;
  faults.phase_short = 2.0;  // b - c
  TerminalSet open = 0;
  TerminalCircuit circuit = connected(Connection::kStar, driven(10.0, 40.0, -20.0), faults, {}, {}, open);
  EXPECT_EQ(circuit.start_v.b, 10.0);
  EXPECT_EQ(circuit.start_v.c, 10.0);
  EXPECT_TRUE(circuit.short_circuit);
  circuit = connected(Connection::kStar, driven(10.0, 5.0, 5.0), faults, {}, {}, open);
  EXPECT_FALSE(circuit.short_circuit);
  faults = {};
  faults.neutral_short = 1.0;
  circuit = connected(Connection::kTwoPhase, driven(10.0, 5.0, 0.0), faults, {}, {}, open);
  EXPECT_EQ(circuit.start.voltage_v.a, 0.0);
  EXPECT_EQ(circuit.start.voltage_v.b, 5.0);
}

// Catches: a terminal that a machine does not have, but that counts as open.
TEST(Terminals, TerminalsThatDoNotExistAreNotOpen) {
  for (const Connection connection : {Connection::kTwoPhase, Connection::kArmature}) {
    TerminalSet open = 7;  // as at the start
    TerminalDrive drive = driven(10.0, 5.0, 0.0);
    drive.constant = false;
    const TerminalCircuit circuit = connected(connection, drive, {}, {}, {}, open);
    EXPECT_EQ(open, 0u);
    EXPECT_EQ(circuit.start.conduction, Conduction::kFull);
  }
}

// Catches: bridges of single windings that share their conduction.
TEST(Terminals, EachBridgeOfItsOwnFloatsByItself) {
  TerminalSet open = 3;
  const WindingValues emf{.stator = {120.0, 80.0}};
  const TerminalCircuit circuit = connected(Connection::kTwoPhase, gates_off(), {}, {}, emf, open);
  EXPECT_EQ(open, 2u);
  EXPECT_EQ(circuit.start_v.a, kRail_v);
  EXPECT_EQ(circuit.start_v.b, 80.0);
  EXPECT_EQ(circuit.start.conduction, Conduction::kLine);
  EXPECT_EQ(circuit.start.line.a, 1.0);
  EXPECT_EQ(circuit.start.line.b, 0.0);
}

}  // namespace
}  // namespace drivebench::terminals_test
