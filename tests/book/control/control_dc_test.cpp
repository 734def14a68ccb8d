// The DC servos of chapter 2 on the product's own bench: the acceptance cases AC-05 to AC-14 and AC-18 of the
// reference. Positions are in encoder counts of 0.00314 rad, and the encoder reads up to one count low.
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <memory>
#include <numbers>
#include <stdexcept>
#include <string>

#include "clients/control/dc/dc_open_loop.hpp"
#include "tests/book/closed_loop.hpp"

namespace drivebench::control_dc_test {
namespace {

using Complex = std::complex<double>;
using control::Gain;

constexpr double kLoad_nm = 0.035;
constexpr double kCount_rad = 2.0 * std::numbers::pi / 2000.0;

/// The mean of a column between two times after the start.
double mean_of(const Outcome& seen, std::string_view column, double from_s, double to_s) {
  const std::size_t index = seen.column(column);
  double sum = 0.0;
  int count = 0;
  for (const ClosedLoopRow& row : seen.rows) {
    if (row.time_s < from_s || row.time_s >= to_s) continue;
    sum += row.telemetry[index];
    ++count;
  }
  return sum / count;
}

const ClosedLoopRow& row_at(const Outcome& seen, double time_s) {
  for (const ClosedLoopRow& row : seen.rows) {
    if (row.time_s > time_s - 1e-6) return row;
  }
  throw std::out_of_range("the run has ended before");
}

/// i/i_r at the frequency of a sine of 1 A over the last ten of thirty periods.
Complex response(std::string_view preset) {
  const Outcome seen = closed_loop(preset);
  constexpr double kPeriod_s = 0.065;
  const double w = 2.0 * std::numbers::pi / kPeriod_s;
  // The command holds for a sample: its sine is half a sample late.
  const double middle_s = 0.5 * 20e-6;
  Complex sum;
  int count = 0;
  for (const ClosedLoopRow& row : seen.rows) {
    if (row.time_s < 20 * kPeriod_s - 1e-9) continue;
    sum += row.sample.true_i_a_a * std::polar(1.0, -w * (row.time_s - middle_s));
    ++count;
  }
  EXPECT_EQ(count, 32500);
  return 2.0 * sum / static_cast<double>(count) * Complex(0.0, 1.0);
}

// AC-05. Catches: a gain or an integral of the controller's own current loop that is off, a command that
// comes a sample late: 0.99592 at -0.545 degrees, with the P loop 0.90631 at 1.681; 0.5 % and 0.1 degrees.
TEST(DcControl, ItsOwnCurrentLoopFollowsASine) {
  const Complex pi = response("book/2.9");
  EXPECT_NEAR(std::abs(pi), 0.99592, 0.005);
  EXPECT_NEAR(std::arg(pi) * 180.0 / std::numbers::pi, -0.545, 0.1);
  const Complex p = response("book/2.9-p");
  EXPECT_NEAR(std::abs(p), 0.90631, 0.0045);
  EXPECT_NEAR(std::arg(p) * 180.0 / std::numbers::pi, 1.681, 0.1);
}

// SPD-01. Catches: a feed-forward: a step to 50 rad/s is missed by f·ω/(f + K·K_T), a sixteenth.
TEST(DcControl, TheProportionalSpeedLoopMissesASixteenth) {
  const Outcome seen = closed_loop("book/2.10");
  EXPECT_NEAR(50.0 - seen.rows.back().sample.speed_rad_s, 3.125, 0.05);
}

/// 1 A throughout.
class OneAmpere final : public control::Trajectory {
 public:
  control::Reference at(double) const noexcept override { return {.acceleration_rad_s2 = 0.07 / 6e-5}; }
  double duration_s() const noexcept override { return 0.7; }
};

/// The bench at 1 A with an observer that controls nothing.
Outcome watched(control::ShaftSpeed source, const control::ShaftObserverGains& gains,
                control::Discretisation how, std::vector<LoadStep> loads) {
  const control::DcOpenLoopParameters p = {
      .axis = {
          .machine = {.resistance_ohm = 2.0,
                      .inductance_h = 2e-3,
                      .torque_constant_nm_per_a = 0.07,
                      .inertia_kgm2 = 6e-5,
                      .friction_nms = 4e-4},
          .sample_rate_hz = 10e3,
          .current_limit_a = 5.0,
          .voltage_limit_v = 40.0,
          .shaft = {
              .counts_per_revolution = 2000.0, .source = source, .observer = gains, .discretisation = how}}};
  ClosedLoop loop("book/2.19-open-loop");
  return loop.run(control::Run(std::make_unique<control::DcOpenLoop>(p), std::make_shared<OneAmpere>(),
                               {.sample_rate_hz = 10e3, .prepare_s = 0.0, .hold_s = 0.0}),
                  loads);
}

double mean_true_speed(const Outcome& seen, double from_s, double to_s) {
  double sum = 0.0;
  int count = 0;
  for (const ClosedLoopRow& row : seen.rows) {
    if (row.time_s < from_s || row.time_s >= to_s) continue;
    sum += row.sample.speed_rad_s;
    ++count;
  }
  return sum / count;
}

constexpr double kFriction = 4e-4 / 6e-5;

// AC-06. Catches: a bias of the two-state observer that is not l1·τ_L/(J·p²): 2.3178 rad/s, 0.2 with an
// encoder.
TEST(DcControl, AnUnknownLoadBiasesTheTwoStateObserver) {
  for (const auto how : {control::Discretisation::kEuler, control::Discretisation::kTrapezoidal,
                         control::Discretisation::kExact}) {
    const Outcome seen = watched(control::ShaftSpeed::kObserver,
                                 control::ShaftObserverGains::placed(std::array{500.0, 500.0}, kFriction),
                                 how, {{kLoad_nm, 0.0}});
    EXPECT_NEAR(mean_of(seen, "speed_rad_s", 0.4, 0.7) - mean_true_speed(seen, 0.4, 0.7), 2.3178, 0.2);
  }
}

// AC-07. Catches: an open-loop copy with another friction or torque than the plant's: after a pulse of 0.1 s
// it is 42.58 rad/s off, and forgets that with J/f = 0.15 s alone; with injection 0.1 rad/s (and the
// encoder's noise) are reached 50 ms after. 1 %.
TEST(DcControl, WithoutInjectionTheErrorOfALoadPulseDecaysSlowly) {
  const std::vector<LoadStep> pulse = {{kLoad_nm, 0.5}, {0.0, 0.6}};
  const Outcome open = watched(control::ShaftSpeed::kObserver, {.angle_per_s = 0.0, .speed_per_s2 = 0.0},
                               control::Discretisation::kTrapezoidal, pulse);
  const auto error_at = [](const Outcome& seen, double t) {
    const ClosedLoopRow& row = row_at(seen, t);
    return row.telemetry[seen.column("speed_rad_s")] - row.sample.speed_rad_s;
  };
  EXPECT_NEAR(row_at(open, 0.5).sample.speed_rad_s, 168.757, 0.2);
  EXPECT_NEAR(row_at(open, 0.6).sample.speed_rad_s, 129.219, 0.2);
  EXPECT_NEAR(error_at(open, 0.6), 42.576, 0.43);
  EXPECT_NEAR(error_at(open, 0.69), 42.576 * std::exp(-0.6), 0.26);
  const Outcome placed = watched(control::ShaftSpeed::kObserver,
                                 control::ShaftObserverGains::placed(std::array{500.0, 500.0}, kFriction),
                                 control::Discretisation::kEuler, pulse);
  EXPECT_NEAR(mean_of(placed, "speed_rad_s", 0.65, 0.70) - mean_true_speed(placed, 0.65, 0.70), 0.0, 0.1);
}

// AC-08. Catches: a load observer with a wrong gain: the step of 0.035 N·m is seen as a triple lag of 5 ms;
// 0.001 N·m of the encoder's noise and 3 %.
TEST(DcControl, TheThreeStateObserverSeesALoadStep) {
  const Outcome seen =
      watched(control::ShaftSpeed::kLoadObserver,
              control::ShaftObserverGains::placed(std::array{200.0, 200.0, 200.0}, kFriction),
              control::Discretisation::kExact, {{kLoad_nm, 0.5}});
  const double times_s[] = {0.510, 0.520, 0.530, 0.550};
  const double expected_nm[] = {0.01132, 0.02667, 0.03283, 0.03490};
  for (std::size_t k = 0; k < 4; ++k) {
    const double load_nm = 6e-5 * row_at(seen, times_s[k]).telemetry[seen.column("load_rad_s2")];
    EXPECT_NEAR(load_nm, expected_nm[k], 1e-3 + 0.03 * expected_nm[k]);
  }
}

/// The half turn in 65 ms: it ends within 70 ms, and within the limits of motor and amplifier.
void expect_half_turn(const Outcome& seen, double late_counts = 2.5) {
  EXPECT_LE(seen.peak_error_rad, 0.015);
  for (const ClosedLoopRow& row : seen.rows) {
    if (row.time_s >= 0.0699) {
      EXPECT_LE(std::abs(row.error_rad), late_counts * kCount_rad) << row.time_s;
    }
  }
  EXPECT_LE(seen.final_encoder_error_counts, 2.0 + 1e-9);
  EXPECT_LT(seen.peak_current_a, 5.0);
  EXPECT_LT(seen.peak_voltage_v, 40.0);
  EXPECT_EQ(seen.saturated_samples, 0);
}

// AC-14. Catches: any mismatch between trajectory, observer, feedback and plant: half a turn in 65 ms with at
// most 0.015 rad. A separate program with the same settings gives 0.0044 rad and 4.27 A, the reference has
// 0.0090 rad and 4.26 A.
TEST(DcControl, HalfATurnTakes65Milliseconds) {
  const Outcome seen = closed_loop("book/2.18");
  expect_half_turn(seen);
  EXPECT_NEAR(seen.peak_error_rad, 0.0045, 0.0015);
  EXPECT_NEAR(seen.peak_current_a, 4.26, 0.1);
  EXPECT_NEAR(seen.peak_voltage_v, 12.2, 0.5);
}

// Catches: a source of speed or a current loop with which the servo fails.
TEST(DcControl, HalfATurnWorksWithEverySourceOfSpeedAndItsOwnCurrentLoop) {
  for (const char* preset : {"book/2.18-own-current-loop", "book/2.18-load-observer", "book/2.23"}) {
    SCOPED_TRACE(preset);
    expect_half_turn(closed_loop(preset));
  }
  // Close to standstill the last edge is old.
  expect_half_turn(closed_loop("book/2.18-edges"), 4.0);
}

// Catches: a command delay that the loop does not tolerate: at 10 kHz and poles at 100 1/s a sample hardly
// matters.
TEST(DcControl, HalfATurnToleratesASampleOfDelay) {
  expect_half_turn(closed_loop("book/2.18", {.command_delay_ticks = 1}));
}

// The mistake that chapter 2 warns of. Catches: a bench with too little encoder noise: steps of 31.4 rad/s in
// the speed are 7.9 A in the command, which stands at its limit.
TEST(DcControl, TheBackwardDifferenceDrivesTheCurrentIntoItsLimit) {
  const Outcome seen = closed_loop("book/2.18-raw-speed");
  EXPECT_GT(seen.saturated_samples, 200);
  EXPECT_GT(seen.peak_error_rad, 0.03);
}

// TRJ-02, TRJ-03. Catches: a trajectory whose references do not fit each other: the feed-forward would miss.
TEST(DcControl, TheOtherTrajectoriesAreFollowedAsWell) {
  const Outcome smooth = closed_loop("book/2.17");
  EXPECT_LE(smooth.peak_error_rad, 0.008);
  EXPECT_LE(smooth.final_encoder_error_counts, 2.0 + 1e-9);
  const Outcome straight = closed_loop("book/2.26");
  EXPECT_LE(straight.peak_error_rad, 0.008);
  EXPECT_LE(straight.final_encoder_error_counts, 2.0 + 1e-9);
  EXPECT_NEAR(straight.peak_current_a, 3.15, 0.1);  // no peak of 4.26 A, but jumps
}

std::string refusal(std::string_view preset, const std::vector<Gain>& gains) {
  try {
    closed_loop(preset, {}, gains);
  } catch (const std::invalid_argument& refused) {
    return refused.what();
  }
  return {};
}

// Catches: a limit that is not checked before the move, with its name and time. With a continuous jerk 65 ms
// would take 5.006 A; 59 ms are the shortest that the cubic can do; at 500 rad/s the voltage does not
// suffice.
TEST(DcControl, AMoveBeyondTheLimitsIsRefusedBeforeItStarts) {
  const std::string smooth = refusal(
      "book/2.17", {{"move.ramp_up_s", 0.025}, {"move.cruise_s", 0.015}, {"move.ramp_down_s", 0.025}});
  EXPECT_NE(smooth.find("armature current of 5.006 A at 0.0107 s"), std::string::npos) << smooth;
  const auto cubic = [](double ramp_s) {
    return std::vector<Gain>{
        {"move.ramp_up_s", ramp_s}, {"move.cruise_s", 0.0}, {"move.ramp_down_s", ramp_s}};
  };
  EXPECT_EQ(refusal("book/2.18", cubic(0.0295)), "");
  EXPECT_NE(refusal("book/2.18", cubic(0.0292)).find("armature current"), std::string::npos);
  const std::string fast = refusal("book/2.19", {{"move.distance_rad", 1000.0},
                                                 {"move.ramp_up_s", 1.0},
                                                 {"move.cruise_s", 1.0},
                                                 {"move.ramp_down_s", 1.0}});
  EXPECT_NE(fast.find("armature voltage of 40"), std::string::npos) << fast;
  EXPECT_NE(refusal("book/2.18", {{"observer.speed_per_s2", -1e5}}).find("unstable"), std::string::npos);
  EXPECT_NE(refusal("book/2.18-load-observer", {{"observer.load_per_s3", 1.25e8}}).find("must be negative"),
            std::string::npos);
}

// AC-10. Catches: a feedback that is weaker than its gains: 0.0158 rad with the true speed (here that of an
// observer which sees the load, 10 %), 0.034 rad with one that does not, and then nothing.
TEST(DcControl, AConstantLoadLeavesNoError) {
  const Outcome seen = closed_loop("book/2.21", {}, {}, {{kLoad_nm, 0.0}});
  EXPECT_NEAR(seen.peak_error_rad, 0.0158, 0.0016);
  EXPECT_LE(seen.final_encoder_error_counts, 1.0 + 1e-9);
  EXPECT_NEAR(mean_of(seen, "i_ref_a", 0.4, 0.6), 0.5, 0.01);
  const Outcome deceived = closed_loop("book/2.21-observer", {}, {}, {{kLoad_nm, 0.0}});
  EXPECT_NEAR(deceived.peak_error_rad, 0.034, 0.0034);
  EXPECT_LE(deceived.final_encoder_error_counts, 1.0 + 1e-9);
}

// AC-11. Catches: an offset that decays differently from the triple pole: −2.571 A at once, 0.0249 rad beyond
// at 30 ms. The current loop, its 40 V and the encoder cost a sixteenth of it.
TEST(DcControl, AnInitialOffsetOvershoots) {
  const Outcome seen = closed_loop("book/2.19-offset");
  EXPECT_NEAR(seen.rows.front().setpoint.a, -2.571, 1e-3);
  double overshoot_rad = 0.0;
  double overshoot_s = 0.0;
  for (const ClosedLoopRow& row : seen.rows) {
    if (row.error_rad > overshoot_rad) {
      overshoot_rad = row.error_rad;
      overshoot_s = row.time_s;
    }
  }
  EXPECT_NEAR(overshoot_rad, 0.0249, 0.0020);
  EXPECT_NEAR(overshoot_s, 0.030, 0.002);
}

// AC-12. Catches: an integral that the loop must not have: 0.10314 rad stay, 0.0583 without the observer's
// bias. 2 % and a count.
TEST(DcControl, WithoutAnIntegralALoadLeavesAnError) {
  const Outcome seen = closed_loop("book/2.21-no-integral", {}, {}, {{kLoad_nm, 0.0}});
  EXPECT_NEAR(mean_of(seen, "angle_error_rad", 0.4, 0.6), 0.10314, 0.0021);
  EXPECT_NEAR(seen.rows.back().error_rad, 0.10314, 0.0021 + kCount_rad);
}

// AC-13. Catches: a feed-forward in the nested loops: 0.150 rad behind at 500 rad/s², 2 % and half a count;
// nothing behind under a load.
TEST(DcControl, NestedLoopsLagAnAcceleration) {
  const Outcome seen = closed_loop("book/2.24");
  EXPECT_NEAR(mean_of(seen, "angle_error_rad", 0.15, 0.199), 0.150, 0.003 + 0.5 * kCount_rad);
  ClosedLoop loop("book/2.24");
  const std::vector<Gain> still = {{"move.distance_rad", 0.0}};
  const std::vector<LoadStep> load = {{kLoad_nm, 0.0}};
  EXPECT_LE(loop.run(still, load).final_encoder_error_counts, 1.0 + 1e-9);
}

// Problem 2.25. Catches: nested loops that are better than they can be, and a table that does not fit: peak
// error, error after 70 ms and current for r = 100, 300 and 500, 3 % and half a count. With r = 500 the
// current is our own: it depends on how loops and limits are sampled (3.9 to 4.98 A in other simulations).
TEST(DcControl, NestedLoopsMissTheirPlaceAfter70Milliseconds) {
  struct Case {
    const char* preset;
    double peak_rad, after_rad, peak_a;
  };
  for (const Case& c : {Case{"book/2.25", 0.642, -0.484, 3.67}, Case{"book/2.25-300", 0.0998, -0.073, 3.62},
                        Case{"book/2.25-500", 0.0378, -0.0175, 4.5}}) {
    const Outcome seen = closed_loop(c.preset);
    EXPECT_NEAR(seen.peak_error_rad, c.peak_rad, 0.03 * c.peak_rad) << c.preset;
    EXPECT_NEAR(row_at(seen, 0.070).error_rad, c.after_rad, -0.03 * c.after_rad + 0.5 * kCount_rad)
        << c.preset;
    EXPECT_NEAR(seen.peak_current_a, c.peak_a, 0.05 * c.peak_a) << c.preset;
    EXPECT_GT(std::abs(row_at(seen, 0.070).error_rad), 2.0 * kCount_rad);
  }
}

// CTL-05. Catches: three loops that do not work together: within a/K_thI of the long move, then at its end.
TEST(DcControl, ThreeNestedLoopsEndAtTheirPlace) {
  const Outcome seen = closed_loop("book/2.27");
  EXPECT_LE(seen.peak_error_rad, 0.22);
  EXPECT_LE(seen.final_encoder_error_counts, 1.0 + 1e-9);
}

// CTL-03. Catches: gains on the wrong error: under a load the angle comes back and the current stays half an
// ampere above its reference.
TEST(DcControl, VoltageFeedbackRemovesTheErrorOfALoad) {
  const Outcome seen = closed_loop("book/2.23", {}, {{"run.hold_s", 0.2}}, {{kLoad_nm, 0.07}});
  EXPECT_LE(seen.final_encoder_error_counts, 1.0 + 1e-9);
  double sum_a = 0.0;
  for (std::size_t k = seen.rows.size() - 500; k < seen.rows.size(); ++k)
    sum_a += seen.rows[k].sample.true_i_a_a / 500.0;
  EXPECT_NEAR(sum_a, 0.5, 0.01);
}

// Problem 2.19 (a-d, e). Catches: an open loop that corrects itself: under 0.035 N·m the reference of 30 rad
// is missed by 39.6 rad and 85.8 rad/s, and with feedback by 0.034 rad at most.
TEST(DcControl, TheLongMoveNeedsItsFeedback) {
  const std::vector<LoadStep> load = {{kLoad_nm, 0.0}};
  const Outcome open = closed_loop("book/2.19-open-loop", {}, {{"run.hold_s", 0.15}}, load);
  const ClosedLoopRow& at_600ms = row_at(open, 0.6);
  EXPECT_NEAR(at_600ms.error_rad, 39.58, 0.1);
  EXPECT_NEAR(at_600ms.reference.speed_rad_s - at_600ms.sample.speed_rad_s, 85.77, 0.2);
  const Outcome seen = closed_loop("book/2.19", {}, {}, load);
  EXPECT_NEAR(seen.peak_error_rad, 0.034, 0.0034);
  EXPECT_LE(seen.final_encoder_error_counts, 1.0 + 1e-9);
  EXPECT_LE(closed_loop("book/2.19").peak_error_rad, 0.0108);
}

// AC-18. Catches: the tachometer's gain, or a speed that is fed back through the error: 400 A at once for a
// radian, and the overshoot of 32.77 % at 0.221 s that the zero of the PI makes; 1 kHz costs 2 % of it.
TEST(DcControl, TheLoopWithTachometerOvershootsByAThird) {
  const Outcome seen = closed_loop("book/2-tachometer");
  EXPECT_NEAR(seen.rows.front().setpoint.a, 400.0, 1e-9);
  double peak_rad = 0.0;
  double peak_s = 0.0;
  for (const ClosedLoopRow& row : seen.rows) {
    if (row.angle_rad > peak_rad) {
      peak_rad = row.angle_rad;
      peak_s = row.time_s;
    }
  }
  EXPECT_NEAR(peak_rad, 1.3277, 0.0066);
  EXPECT_NEAR(peak_s, 0.221, 0.003);
  EXPECT_NEAR(seen.rows.back().error_rad, 0.0, 1e-3);
}

// AC-18. Catches: an integral in the proportional loop: a turn of ω_0 is followed ω_0/K behind.
TEST(DcControl, TheProportionalLoopFollowsARampBehind) {
  const Outcome seen = closed_loop("book/2-proportional");
  EXPECT_NEAR(seen.rows.back().error_rad, 0.3, 1e-3);
}

// CTL-07. Catches: a compensator without the sine: its error would stay.
TEST(DcControl, ASineIsFollowedByALoopThatContainsIt) {
  const Outcome seen = closed_loop("book/2-sine");
  EXPECT_NEAR(row_at(seen, 10.0).error_rad, 0.425, 0.005);
  for (const ClosedLoopRow& row : seen.rows) {
    if (row.time_s > 38.0) {
      ASSERT_LT(std::abs(row.error_rad), 0.01) << row.time_s;
    }
  }
}

}  // namespace
}  // namespace drivebench::control_dc_test
