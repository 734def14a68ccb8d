#include <gtest/gtest.h>

#include <Eigen/Core>
#include <Eigen/LU>
#include <cmath>
#include <complex>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <numbers>
#include <unsupported/Eigen/MatrixFunctions>

#include "clients/regression/checks/frequency_response.hpp"
#include "server/config/config.hpp"
#include "tests/clients/regression/check_on_course.hpp"

// Loops whose gain is known in closed form, around the motor of problem 2.1 of the book, on the product's
// bench.
namespace drivebench::regression::response_test {
namespace {

using Complex = std::complex<double>;
using Matrix = Eigen::MatrixXd;

constexpr Owner kOwner = 7;
constexpr double kTick_s = 1e-4;
constexpr double kResistance_ohm = 2.0;
constexpr double kInductance_h = 2e-3;
constexpr double kTorque_nm_per_a = 0.07;
constexpr double kInertia_kgm2 = 6e-5;
constexpr double kFriction_nms = 4e-4;

/// A PI controller of samples: u = K_P·e + the sum of K_I·T·e of the samples before.
struct Pi {
  double proportional;
  double integral_per_s;
  double sum = 0.0;

  double step(double error) {
    const double u = proportional * error + sum;
    sum += integral_per_s * kTick_s * error;
    return u;
  }
  Complex at(Complex z) const { return proportional + integral_per_s * kTick_s / (z - 1.0); }
};

/// The bench dc-a-voltage with a delay of so many ticks and this event.
BenchConfig bench_with(int delay_ticks, const std::string& more) {
  const std::filesystem::path folder = std::filesystem::path(DRIVEBENCH_CONFIGS) / "benches";
  std::ifstream in(folder / "dc-a-voltage.toml");
  std::string text(std::istreambuf_iterator<char>(in), {});
  const std::string delay = "command_delay_ticks = ";
  text.replace(text.find(delay), delay.size() + 1, delay + std::to_string(delay_ticks));
  return parse_config(text + more, "loop.toml", folder);
}

/// What the check of these keys finds on a bench that a controller drives with a voltage.
Finding found_on(const BenchConfig& config, const std::string& keys, const Excitation& excitation,
                 const std::function<double(const Sample&)>& controller) {
  std::string problem;
  std::optional<CheckSpec> spec = spec_of("kind = \"frequency_response\"\n" + keys, problem);
  if (!spec) throw std::runtime_error(problem);
  spec->axis = "one";
  spec->excitation = excitation;
  spec->from_s = excitation.begin_s + excitation.period_s;
  spec->to_s = excitation.begin_s + excitation.periods * excitation.period_s;
  const auto end_tick = static_cast<std::uint64_t>(*spec->to_s / kTick_s + 10.0);
  const RunFacts facts{.period_s = kTick_s, .end_tick = end_tick, .axes = {"one"}, .faults = {}};
  EXPECT_EQ(problem_on_bench(*spec, facts), "");
  const std::unique_ptr<Check> check = spec->kind->make(*spec, facts);
  Bench bench(config.setup);
  schedule_events(config, bench);
  bench.submit({.tick = 0, .axis = 0, .owner = kOwner, .action = LeaseAction::kAcquire});
  while (static_cast<std::uint64_t>(bench.tick()) <= end_tick) {
    const Sample& sample = bench.sample(0);
    check->see(std::span(&sample, 1));
    const PhaseCommand volts{.gates = Gates::kVoltage, .setpoint = {.a = controller(sample)}};
    EXPECT_EQ(bench.submit({.tick = bench.tick(),
                            .axis = 0,
                            .owner = kOwner,
                            .action = Command{.answers = bench.tick(), .phases = volts}}),
              Refused::kNot);
    bench.step();
  }
  return check->finish();
}

/// The motor over a tick with constant voltage and load: current and speed, x' = A·x + B·(u, load), exactly.
struct SampledMotor {
  Matrix a;
  Matrix b;

  SampledMotor() {
    Matrix m = Matrix::Zero(4, 4);
    m.topRows(2) << -kResistance_ohm / kInductance_h, -kTorque_nm_per_a / kInductance_h, 1.0 / kInductance_h,
        0.0, kTorque_nm_per_a / kInertia_kgm2, -kFriction_nms / kInertia_kgm2, 0.0, -1.0 / kInertia_kgm2;
    const Matrix e = (m * kTick_s).exp();
    a = e.topLeftCorner(2, 2);
    b = e.topRightCorner(2, 2);
  }
  /// (z·I - A + column·row)⁻¹·B(input)
  Eigen::Vector2cd response(Complex z, int input, const Eigen::Matrix2cd& feedback) const {
    const Eigen::Matrix2cd m = z * Eigen::Matrix2cd::Identity() - a.cast<Complex>() + feedback;
    return m.inverse() * b.col(input).cast<Complex>();
  }
};

Complex z_at(double hz) {
  return std::polar(1.0, 2.0 * std::numbers::pi * hz * kTick_s);
}

/// Each line against the closed form, in decibels and degrees.
void expect_lines(const Finding& finding, const std::function<Complex(double)>& loop, double db, double deg) {
  ASSERT_GT(finding.response.size(), 15U) << finding.sentence;
  for (const ResponsePoint& p : finding.response) {
    const Complex wanted = loop(p.hz);
    const Complex measured =
        std::polar(std::pow(10.0, p.gain_db / 20.0), p.phase_deg * std::numbers::pi / 180.0);
    EXPECT_NEAR(20.0 * std::log10(std::abs(measured / wanted)), 0.0, db) << p.hz;
    EXPECT_NEAR(std::arg(measured / wanted) * 180.0 / std::numbers::pi, 0.0, deg) << p.hz;
  }
}

constexpr Excitation kOnCurrent{.is_load = false,
                                .amplitude = 0.02,
                                .begin_s = 0.05,
                                .has_trigger = false,
                                .period_s = 0.1,
                                .periods = 6.0,
                                .from_hz = 20.0,
                                .to_hz = 4000.0,
                                .ratio = 1.25};
const std::string kCurrentEvent =
    "\n[[axis.fault]]\nat_s = 0.0\nname = \"blocked_rotor\"\nvalue = 1\n"
    "[[axis.multisine]]\nat_s = 0.05\ncurrent_offset_a = 0.02\nperiod_s = 0.1\nperiods = 6\n"
    "from_hz = 20.0\nto_hz = 4000.0\n";

/// The gain of a PI loop around the winding of a blocked rotor, i' = (u - R·i)/L held over a tick, with this
/// delay of the command.
Complex current_loop(const Pi& pi, int delay_ticks, double hz) {
  const Complex z = z_at(hz);
  const double a = std::exp(-kResistance_ohm / kInductance_h * kTick_s);
  return pi.at(z) * std::pow(z, -delay_ticks) * (1.0 - a) / (kResistance_ohm * (z - a));
}

// Catches: an injection that is a sample early or late, a loop gain that is a closed one, margins at the
// wrong place. The bench integrates with steps of a fifth of a tick; 0.001 dB and 0.01 degrees are a hundred
// times what that and the transients of the first period leave.
TEST(FrequencyResponse, OfACurrentLoopIsThatOfItsClosedForm) {
  for (const int delay : {0, 1}) {
    Pi pi{.proportional = 5.0, .integral_per_s = 5000.0};
    const Pi as_designed = pi;
    const Finding found = found_on(bench_with(delay, kCurrentEvent),
                                   delay == 0 ? "min_gain_margin_db = 6\n" : "min_phase_margin_deg = 30\n",
                                   kOnCurrent, [&pi](const Sample& s) { return pi.step(0.5 - s.i_a_a); });
    const auto loop = [&](double hz) { return current_loop(as_designed, delay, hz); };
    expect_lines(found, loop, 1e-3, 1e-2);
    const LoopMargins margins = margins_of(found.response);
    ASSERT_TRUE(margins.crossover);
    const Complex at_crossover = loop(margins.crossover->hz);
    // The cubics between lines of a ratio of 1.25 are right to so much.
    EXPECT_NEAR(std::abs(at_crossover), 1.0, 2e-3);
    EXPECT_NEAR(180.0 + std::arg(at_crossover) * 180.0 / std::numbers::pi, margins.phase_margin_deg, 0.1);
    EXPECT_EQ(found.passed, delay == 1) << found.sentence;
    if (delay == 0) {  // a bound on a margin that was not seen fails
      EXPECT_NE(found.sentence.find("the phase does not cross -180 deg"), std::string::npos)
          << found.sentence;
      continue;
    }
    EXPECT_EQ(found.measured, margins.phase_margin_deg);
    ASSERT_TRUE(margins.reversal);
    const Complex at_reversal = loop(margins.reversal->hz);
    EXPECT_NEAR(-20.0 * std::log10(std::abs(at_reversal)), margins.gain_margin_db, 0.05);
    EXPECT_NEAR(std::remainder(std::arg(at_reversal) * 180.0 / std::numbers::pi - 180.0, 360.0), 0.0, 0.2);
  }
}

// Catches: noise that is taken for gain. The noise of 10 mA rms and 12 bits of 12 A (2.9 mA) beside lines of
// 20 mA leaves, over 5 periods of 1000 samples, 10.4 mA·sqrt(2/5000)/20 mA = 1 % of each line, 0.09 dB; four
// of those, times the 1/|1 + G| by which little is seen where the gain is large. Each line tells its own
// error.
TEST(FrequencyResponse, StandsNoiseAndRoundingAndTellsTheError) {
  const std::string sensor = "\n[axis.current_sensor]\nbits = 12\nfull_scale_a = 6.0\nnoise_rms_a = 0.01\n";
  Pi pi{.proportional = 5.0, .integral_per_s = 5000.0};
  const Pi as_designed = pi;
  const Finding found = found_on(bench_with(1, sensor + kCurrentEvent), "min_phase_margin_deg = 30\n",
                                 kOnCurrent, [&pi](const Sample& s) { return pi.step(0.5 - s.i_a_a); });
  ASSERT_GT(found.response.size(), 15U) << found.sentence;
  double largest = 0.0;
  for (const ResponsePoint& p : found.response) {
    const Complex wanted = current_loop(as_designed, 1, p.hz);
    const Complex measured =
        std::polar(std::pow(10.0, p.gain_db / 20.0), p.phase_deg * std::numbers::pi / 180.0);
    const double off = std::abs(measured / wanted - 1.0);
    EXPECT_LT(off, 5.0 * p.error + 1e-4) << p.hz;
    EXPECT_GT(p.error, 1e-4) << p.hz;
    if (p.error <= kLargestResponseError) largest = std::max(largest, off);
  }
  EXPECT_GT(largest, 1e-3);
  EXPECT_LT(largest, 0.2);
  EXPECT_TRUE(found.passed) << found.sentence;
  const Complex at_crossover =
      current_loop(as_designed, 1, margins_of(readable(found.response)).crossover->hz);
  EXPECT_NEAR(std::abs(at_crossover), 1.0, 0.03);
}

constexpr Excitation kOnLoad{.is_load = true,
                             .amplitude = 1e-3,
                             .begin_s = 0.3,
                             .has_trigger = false,
                             .period_s = 0.5,
                             .periods = 4.0,
                             .from_hz = 2.0,
                             .to_hz = 500.0,
                             .ratio = 1.25};
const std::string kLoadEvent =
    "\n[[axis.multisine]]\nat_s = 0.3\nload_nm = 1e-3\nperiod_s = 0.5\nperiods = 4\nfrom_hz = 2.0\nto_hz = "
    "500.0\n";

// Catches: a load that is half a tick off, the sign of the load, an answer that is not the torque of the
// motor. Of a speed loop broken at the shaft L = K·(K + C·e^(-sT_d))/((R + sL)(J·s + B)), with the delay of
// the command and half a tick of the hold: the loop that an engineer draws by hand. Samples and holds differ
// from it by less than 0.1 dB and 1 degree below a twentieth of the rate. The exact sampled loop is met 100
// times closer.
TEST(FrequencyResponse, OfASpeedLoopIsMeasuredByTheLoad) {
  for (const int delay : {0, 1}) {
    Pi pi{.proportional = 0.2, .integral_per_s = 4.0};
    const Pi as_designed = pi;
    const Finding found = found_on(bench_with(delay, kLoadEvent), "min_phase_margin_deg = 50\n", kOnLoad,
                                   [&pi](const Sample& s) { return pi.step(50.0 - s.speed_rad_s); });
    const SampledMotor motor;
    expect_lines(
        found,
        [&](double hz) {
          const Complex z = z_at(hz);
          Eigen::Matrix2cd feedback = Eigen::Matrix2cd::Zero();
          feedback.col(1) = motor.b.col(0).cast<Complex>() * as_designed.at(z) * std::pow(z, -delay);
          const double half_turn = std::numbers::pi * hz * kTick_s;
          const Complex hold = std::polar(std::sin(half_turn) / half_turn, -half_turn);
          const Complex g = kTorque_nm_per_a * motor.response(z, 1, feedback)[0] / hold;
          return g / (1.0 - g);
        },
        1e-3, 1e-2);
    expect_lines(
        found,
        [&](double hz) {
          const Complex s(0.0, 2.0 * std::numbers::pi * hz);
          const Complex controller = (as_designed.proportional + as_designed.integral_per_s / s) *
                                     std::exp(-s * kTick_s * (0.5 + delay));
          return kTorque_nm_per_a * (kTorque_nm_per_a + controller) /
                 ((kResistance_ohm + s * kInductance_h) * (s * kInertia_kgm2 + kFriction_nms));
        },
        0.1, 1.0);
    EXPECT_TRUE(found.passed) << found.sentence;
  }
}

// Catches: a closed loop's point that is that of the open one, a bound on the wrong side.
TEST(FrequencyResponse, OfASignalHasItsPoints) {
  const auto hold = [](Pi pi, const std::string& keys) {
    return found_on(bench_with(0, kLoadEvent), keys, kOnLoad,
                    [&pi](const Sample& s) { return pi.step(50.0 - s.speed_rad_s); });
  };
  const Pi pi{.proportional = 0.2, .integral_per_s = 4.0};
  const std::string point = "signal = \"torque_nm\"\nat_hz = 3.0\n";
  // Far below the crossover the motor's torque is that of the load.
  EXPECT_TRUE(hold(pi, point + "min_db = -0.5\nmax_db = 0.5\nmin_deg = -15\nmax_deg = 15\n").passed);
  const Finding failed = hold(pi, point + "max_db = -0.5\n");
  EXPECT_FALSE(failed.passed);
  EXPECT_NEAR(failed.measured, 0.0, 0.5);
  EXPECT_NE(failed.sentence.find(", max -0.5 dB"), std::string::npos) << failed.sentence;
  EXPECT_FALSE(hold(pi, "signal = \"torque_nm\"\nat_hz = 900.0\nmax_db = 3\n").passed);
}

std::vector<ResponsePoint> integrator_with_delay(double delay_s) {
  std::vector<ResponsePoint> points;
  for (double hz = 1.0; hz < 1000.0; hz *= 1.25)
    points.push_back({.hz = hz,
                      .gain_db = 20.0 * std::log10(50.0 / hz),
                      .phase_deg = -90.0 - 360.0 * hz * delay_s,
                      .error = 0.0});
  return points;
}

// Catches: margins read at the next line, a phase that is not continued beyond half a turn.
TEST(LoopMargins, OfAnIntegratorWithDelayAreItsFormulas) {
  std::vector<ResponsePoint> points = integrator_with_delay(1e-3);
  for (ResponsePoint& p : points)
    p.phase_deg = std::remainder(p.phase_deg, 360.0);
  unwrap(points);
  const LoopMargins m = margins_of(points);
  ASSERT_TRUE(m.crossover && m.reversal);
  EXPECT_NEAR(m.crossover->hz, 50.0, 1e-6);
  EXPECT_NEAR(m.phase_margin_deg, 72.0, 0.02);
  EXPECT_NEAR(m.reversal->hz, 250.0, 0.1);
  EXPECT_NEAR(m.gain_margin_db, 20.0 * std::log10(5.0), 0.01);
}

// Catches: a margin where none was measured, one that is read from a line of noise.
TEST(LoopMargins, AreNotReadBeyondTheLinesOrFromNoise) {
  std::vector<ResponsePoint> points = integrator_with_delay(1e-5);
  EXPECT_FALSE(margins_of(points).reversal);
  EXPECT_FALSE(margins_of({}).crossover);
  points[3].gain_db = -3.0;
  points[3].phase_deg = -170.0;
  points[3].error = 0.5;
  const LoopMargins m = margins_of(readable(points));
  EXPECT_NEAR(m.crossover->hz, 50.0, 1e-3);
}

// Catches: a check without a bound, or with bounds that do not fit together, that is taken.
TEST(FrequencyResponse, NeedsBoundsThatFitTogether) {
  const std::string kind = "kind = \"frequency_response\"\n";
  EXPECT_NE(problem_of_check(kind).find("has no bound"), std::string::npos);
  EXPECT_NE(problem_of_check(kind + "at_hz = 3.0\n").find("at_hz without a bound"), std::string::npos);
  EXPECT_NE(
      problem_of_check(kind + "at_hz = 3.0\nmin_db = 1.0\nmin_gain_margin_db = 6.0\n").find("give each"),
      std::string::npos);
}

}  // namespace
}  // namespace drivebench::regression::response_test
