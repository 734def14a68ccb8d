#include "tests/clients/identification/monte_carlo/blind.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <tuple>
#include <vector>

namespace drivebench::identification::blind_test {
namespace {

// One motor of each kind: its wiring is found and every parameter stated. Catches: a blind run that tells the
// identification the answer, one whose wiring is not found, a seed without influence.
TEST(Blind, MotorsAndWiringsOfASeedAreFound) {
  const std::vector<BlindMotor> motors = run_blind(7, 1, 2);
  ASSERT_EQ(motors.size(), 5U);
  for (const BlindMotor& m : motors) {
    EXPECT_TRUE(m.wired()) << m.draw->name;
    EXPECT_TRUE(m.certified) << m.draw->name;
    for (const Finding& f : m.findings) {
      EXPECT_TRUE(f.stated);
      EXPECT_LT(std::abs(f.estimate - f.truth), 2.0 * f.interval) << m.draw->name << " " << f.truth;
    }
  }
  EXPECT_NE(blind_motor(motor_draws()[0], 8, 1).findings[0].truth, motors[0].findings[0].truth);
}

// Motors whose voltages change so slowly that the busiest part of the record does not tell by how many
// samples they are late; the whole of it does. Catches: a motor that is certified on a shift which was
// assumed (R_S was 14 % off, f 26 %), line voltages a whole number of samples late that are taken for means
// of periods.
TEST(Blind, TheWholeRecordTellsTheDelayThatAPartHides) {
  for (const auto& [kind, seed, number] : {std::tuple(1, 7, 2), std::tuple(2, 20261124, 1)}) {
    const BlindMotor m =
        blind_motor(motor_draws()[static_cast<std::size_t>(kind)], static_cast<std::uint64_t>(seed), number);
    EXPECT_TRUE(m.shift) << m.draw->name;
    for (const Finding& f : m.findings)
      EXPECT_LT(std::abs(f.estimate - f.truth), 2.0 * f.interval) << m.draw->name << " " << f.truth;
  }
}

// Catches: a score that counts an estimate which was taken back, or forgets a kind.
TEST(Blind, TheScoreCountsWhatIsStatedAndHeld) {
  const MotorDraw draw = {.kind = MotorKind::kDc,
                          .name = "motors",
                          .bench = "bench",
                          .experiment = "A run.",
                          .identified = {},
                          .others = {},
                          .longest_s = 0.0};
  BlindMotor m{
      .draw = &draw, .pole_pairs = true, .direction = true, .shift = true, .zero = true, .certified = false};
  m.findings = {{.truth = 2.0, .estimate = 2.02, .interval = 0.03, .stated = true},
                {.truth = 2.0, .estimate = 2.04, .interval = 0.03, .stated = true},
                {.truth = 2.0}};
  const std::string text = blind_markdown(5, {m});
  EXPECT_NE(text.find("| motors | 1 | 1 | 0 | 2 of 3 | 1 of 2 | 1.000 % | 2.000 % |"), std::string::npos)
      << text;
  EXPECT_NE(text.find("| all | 1 | 1 | 0 | 2 of 3 | 1 of 2 |"), std::string::npos) << text;
}

}  // namespace
}  // namespace drivebench::identification::blind_test
