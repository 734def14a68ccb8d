// Input-output linearisation and related laws on the product's own bench, in process: cases 8 to 11 and
// exercise 15 of the reference table, and the laws for which the book gives equations only. With the flux
// gains of the text the last digits are chaotic, hence bounds instead of numbers there.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tests/book/closed_loop.hpp"

namespace drivebench::control_induction_test {
namespace {

/// Samples from the start of the trajectory on in which the law was not applied.
std::int64_t singular_samples(const Outcome& seen) {
  const std::size_t column = seen.column("singular");
  return std::ranges::count_if(seen.rows, [column](const ClosedLoopRow& row) {
    return row.phase != control::RunPhase::kPreparing && row.telemetry[column] != 0.0;
  });
}

/// The refusal of make() for these gains; empty if it takes them.
std::string refusal(std::string_view preset, std::vector<control::Gain> gains) {
  try {
    control::find_preset(preset)->make(gains);
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return {};
}

// Case 8. Catches: a flux reference that the machine cannot follow, a torque table that is off, or a division
// by the wrong flux. The table has 3.7 counts, 5.8 A, 6 saturated samples, ψ from 0.0133 to 0.0473 Wb.
TEST(InductionControl, ASoftFluxLoopMakesTheMoveTo8000Rpm) {
  const Outcome seen = closed_loop("book/8.2.5-soft-flux");
  EXPECT_LE(seen.peak_error_counts, 8.0);
  EXPECT_NEAR(seen.peak_error_counts, 3.7, 0.7);
  EXPECT_LE(seen.final_error_counts, 1.0);
  EXPECT_LT(seen.final_encoder_error_counts, 2.0);  // the end of the move lies within a count
  EXPECT_NEAR(seen.peak_speed_rad_s, 837.7, 2.0);
  EXPECT_NEAR(seen.peak_current_a, 5.8, 0.15);
  EXPECT_LT(seen.peak_current_a, 6.0);
  EXPECT_EQ(seen.peak_setpoint, 80.0);
  EXPECT_GE(seen.saturated_samples, 1);
  EXPECT_LE(seen.saturated_samples, 20);
  EXPECT_EQ(seen.samples, 200 + 2580 + 200);
  double least_flux_wb = 1.0;
  for (const ClosedLoopRow& row : seen.rows) {
    if (row.phase == control::RunPhase::kMoving)
      least_flux_wb = std::min(least_flux_wb, row.telemetry[seen.column("flux_wb")]);
  }
  EXPECT_NEAR(least_flux_wb, 0.0133, 0.002);
  EXPECT_NEAR(seen.peak_of("flux_wb"), 0.0473, 0.0015);
}

// Case 9. Catches: a limit cycle that moves the shaft: the flux loop swings between ±5.9 A and more than a
// thousand samples are saturated, yet the text's 34 counts are kept: 11 to 31 over inertias that differ by
// 1e-9. The table has 15 to 18, 1600 samples, 9.9 A.
TEST(InductionControl, TheGainsOfTheTextMakeTheMoveTo8000Rpm) {
  const Outcome seen = closed_loop("book/8.2.5");
  EXPECT_LE(seen.peak_error_counts, 50.0);
  EXPECT_LE(seen.final_encoder_error_counts, 3.0);
  EXPECT_NEAR(seen.peak_of("i_d_ref_a"), 5.88, 1e-9);
  EXPECT_GT(seen.saturated_samples, 1000);
  EXPECT_GT(seen.peak_current_a, 8.0);
}

// Case 10, negative. Catches: a bench or move so easy that constant flux would do. The table fails with 15500
// to 20900 counts.
TEST(InductionControl, ConstantFluxCannotMakeTheMoveTo8000Rpm) {
  const Outcome seen = closed_loop("book/8.2.5-constant-flux");
  EXPECT_GT(seen.final_error_counts, 1000.0);
  EXPECT_GT(2 * seen.saturated_samples, seen.samples);
  EXPECT_LT(seen.peak_speed_rad_s, 750.0);
}

// Case 11, negative: above 100 counts. Catches: friction that the bench leaves out at high speed. The motor
// falls out of step: 170 to 420 counts with the text's gains, by the last bit, 846 with the soft ones; with
// 6e-5 the move is still made (4.9 counts).
TEST(InductionControl, FrictionForbidsTheMoveTo8000Rpm) {
  const Outcome text = closed_loop("book/8.2.5-friction");
  EXPECT_GT(text.peak_error_counts, 100.0);
  EXPECT_GT(closed_loop("book/8.2.5-soft-flux", {.bench = "servo-4khz"}).peak_error_counts, 100.0);
  const Outcome less =
      closed_loop("book/8.2.5-soft-flux", {.parameters = {{"mechanics.viscous_friction_nms", 6e-5}}});
  EXPECT_LE(less.peak_error_counts, 8.0);
}

// Negative. Catches: a check that passes an impossible move, or that refuses without the reason and the time;
// the presets that show failures are marked as unchecked.
TEST(InductionControl, MovesBeyondALimitAreRefusedBeforeTheyStart) {
  EXPECT_EQ(refusal("book/8.2.5-soft-flux", {}), "");
  EXPECT_EQ(refusal("book/8.2.5-soft-flux", {{"machine.friction_nms", 1.4e-4}}),
            "the move cannot be made: stator current of 6.024 A at 0.01825 s is above the limit of 6 A");
  const std::string voltage = refusal("book/8.2.5-constant-flux", {{"allowed.voltage_v", 80.0}});
  EXPECT_NE(voltage.find("stator voltage of 80.05 V at 0.0995 s"), std::string::npos) << voltage;
  const std::string braking = refusal("book/8.2.5-field-weakening", {{"allowed.current_a", 6.0}});
  EXPECT_NE(braking.find("stator current"), std::string::npos) << braking;
  EXPECT_NE(refusal("book/8.2.5-soft-flux", {{"move.run_up_s", 0.1}}).find("move.run_up_s does not fit"),
            std::string::npos);
}

// Catches: field weakening that does not weaken: it follows the move as well, but braking takes more than the
// amplifier's 6 A. (The table loses the move; its law and limits are not stated.)
TEST(InductionControl, StandardFieldWeakeningNeedsMoreCurrent) {
  const Outcome seen = closed_loop("book/8.2.5-field-weakening");
  EXPECT_LE(seen.peak_error_counts, 8.0);
  EXPECT_GT(seen.peak_current_a, 7.0);
}

// Negative. Catches: a move that tolerates any timing: a sample of delay at 4 kHz is 36 degrees of flux
// angle. The table has 10937 counts.
TEST(InductionControl, ASampleOfDelayLosesTheMoveTo8000Rpm) {
  EXPECT_GT(closed_loop("book/8.2.5-soft-flux", {.command_delay_ticks = 1}).peak_error_counts, 1000.0);
}

// Catches: an observer or gain with 4 kHz built in: at 8 kHz the delay is tolerated. The table has 1.9
// counts.
TEST(InductionControl, At8KilohertzADelayIsTolerated) {
  const Outcome seen =
      ClosedLoop("book/8.2.5-soft-flux", {.bench = "servo-frictionless", .command_delay_ticks = 1})
          .run({{"sample_rate_hz", 8000.0}});
  EXPECT_LE(seen.peak_error_counts, 4.0);
}

// Exercise 15(a). Catches: a flux loop that needs its feed-forward. The table has 1.73 and 7.8 counts.
TEST(InductionControl, HalfATurnNeedsNoFeedForwardOfTheFlux) {
  EXPECT_NEAR(closed_loop("exercise/8.15a-field-oriented").peak_error_counts, 1.73, 0.5);
  EXPECT_NEAR(closed_loop("exercise/8.15a").peak_error_counts, 7.8, 3.0);
}

// Exercise 15(b). Catches: weakening from the wrong speed on: 60 V would not do. The table has 0.81 counts,
// 58.4 V and 3.98 A, and 6.3 counts with the text's gains, whose limit cycle makes that number a coincidence
// (12.4 here).
TEST(InductionControl, FieldWeakeningReaches838RadiansPerSecond) {
  const Outcome seen = closed_loop("exercise/8.15b");
  EXPECT_NEAR(seen.peak_error_counts, 0.81, 0.7);  // 0.98 to 1.28 over inertias that differ by 1e-9
  EXPECT_NEAR(seen.peak_current_a, 3.98, 0.1);
  EXPECT_NEAR(seen.peak_speed_rad_s, 838.0, 1.0);
  EXPECT_LE(seen.saturated_samples, 5);  // the first sample of the flux build-up
  double peak_v = 0.0;
  for (const ClosedLoopRow& row : seen.rows) {
    if (row.phase != control::RunPhase::kPreparing) peak_v = std::max(peak_v, std::abs(row.setpoint.a));
  }
  EXPECT_NEAR(peak_v, 58.4, 2.0);
  EXPECT_LE(closed_loop("exercise/8.15b-text-gains").peak_error_counts, 30.0);
}

// IMC-06. Catches: a decoupling that does not decouple: half a turn with four and three poles and no current
// loop. Ours: 0.88 counts, 5.88 A; with a sample of delay 1.21 counts.
TEST(InductionControl, VoltageCommandNeedsNoCurrentLoop) {
  const Outcome seen = closed_loop("book/8.2.5-voltage");
  EXPECT_LE(seen.peak_error_counts, 1.5);
  EXPECT_LT(seen.peak_current_a, 6.0);
  EXPECT_EQ(seen.saturated_samples, 0);
  EXPECT_LE(closed_loop("book/8.2.5-voltage", {.command_delay_ticks = 1}).peak_error_counts, 2.0);
}

// IMC-07. Catches: a singularity that is reported where there is none, or passed unnoticed: the flux may fall
// at 0.4 Wb/s, and not at 2.7.
TEST(InductionControl, AnIntegratorOnTheDirectAxisFollowsAFallingFlux) {
  const Outcome seen = closed_loop("exercise/8.28");
  EXPECT_LE(seen.peak_error_counts, 1.5);
  EXPECT_EQ(singular_samples(seen), 0);
  const Outcome steep = closed_loop("exercise/8.28-singular");
  EXPECT_GT(singular_samples(steep), 5);
  EXPECT_LE(steep.peak_error_counts, 4.0);  // the plain law takes over
}

// IMC-08. Catches: a load observer of the wrong size: lifting 0.25 N·m the torque never passes through zero
// and the law holds throughout; without load it must give way at rest.
TEST(InductionControl, AnIntegratorOnTheQuadratureAxisLiftsALoad) {
  const Outcome seen = closed_loop("exercise/8.29");
  EXPECT_LE(seen.peak_error_while_moving_counts, 3.0);
  EXPECT_EQ(singular_samples(seen), 0);
  EXPECT_NEAR(seen.rows.back().telemetry[seen.column("load_nm")], 0.25, 0.01);
  const Outcome without = closed_loop("exercise/8.29-no-load");
  EXPECT_GT(singular_samples(without), 100);
  EXPECT_LE(without.peak_error_counts, 3.0);
}

/// Rates of the flux from the rotor, ρ_R', while the run moves: smallest and largest, over 5 ms each [rad/s].
std::pair<double, double> slips(const Outcome& seen) {
  constexpr std::size_t kApart = 40;
  constexpr double kPolePairs = 3.0;
  const auto from_rotor_rad = [](const Sample& s) {
    return std::atan2(s.psi_b_wb, s.psi_a_wb) - kPolePairs * s.angle_rad;
  };
  std::pair<double, double> found{HUGE_VAL, -HUGE_VAL};
  for (std::size_t k = kApart; k < seen.rows.size(); ++k) {
    if (seen.rows[k].phase != control::RunPhase::kMoving) continue;
    const double turned_rad =
        std::remainder(from_rotor_rad(seen.rows[k].sample) - from_rotor_rad(seen.rows[k - kApart].sample),
                       2.0 * std::numbers::pi);
    const double slip_rad_s = turned_rad / (125e-6 * kApart);
    found = {std::min(found.first, slip_rad_s), std::max(found.second, slip_rad_s)};
  }
  return found;
}

// Exercise 30. Catches: a flux that does not belong to the torque, i_d without ψ', a torque without n_p:
// along the flat outputs the flux turns from the rotor at the constant rate η = 278.6 1/s while the torque
// changes threefold, to 15 % (a count moves the torque by 0.04 N·m, hence the 5 ms), and in the hold both
// currents are √(R_R·τ/(n_p·η))/M = 2.92 A.
TEST(InductionControl, AlongTheFlatOutputsTheSlipIsConstant) {
  const Outcome seen = closed_loop("exercise/8.30");
  EXPECT_LE(seen.peak_error_while_moving_counts, 3.0);
  EXPECT_LE(seen.final_encoder_error_counts, 1.0 + 1e-9);
  const std::size_t singular = seen.column("singular");
  for (const ClosedLoopRow& row : seen.rows) {
    if (row.phase != control::RunPhase::kPreparing) {
      ASSERT_EQ(row.telemetry[singular], 0.0) << row.time_s;
    }
  }
  const auto [least, most] = slips(seen);
  EXPECT_NEAR(least, 278.6, 42.0);
  EXPECT_NEAR(most, 278.6, 42.0);
  const double expected_a = std::sqrt(3.9 * 0.25 / (3.0 * 278.57)) / 0.0117;
  EXPECT_NEAR(seen.rows.back().telemetry[seen.column("i_d_a")], expected_a, 0.02 * expected_a);
  EXPECT_NEAR(seen.rows.back().telemetry[seen.column("i_q_a")], expected_a, 0.02 * expected_a);
}

}  // namespace
}  // namespace drivebench::control_induction_test
