#include "server/bench/multisine.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "tests/server/bench/servo_bench.hpp"

namespace drivebench::multisine_test {
namespace {

constexpr MultisineLines kLines{.period_ticks = 400, .lowest = 2, .highest = 150, .ratio = 1.5};
constexpr Multisine kOnLoad{
    .quantity = Multisine::Quantity::kLoad, .periods = 2, .amplitude = 0.01, .lines = kLines};

Input at(Tick tick, const Action& action) {
  return {.tick = tick, .axis = 0, .owner = 0, .action = action};
}

/// The amplitude of a multiple of 1/period.
double amplitude_of(const std::vector<double>& period, std::uint64_t multiple) {
  std::complex<double> sum = 0.0;
  for (std::size_t k = 0; k < period.size(); ++k)
    sum += period[k] *
           std::polar(1.0, -2.0 * std::numbers::pi * static_cast<double>(multiple * k % period.size()) /
                               static_cast<double>(period.size()));
  return 2.0 * std::abs(sum) / static_cast<double>(period.size());
}

// Catches: lines elsewhere than a check asks for, of another amplitude, or with a peak as of equal phases.
TEST(Multisine, HasItsLinesAndNothingBetweenThem) {
  std::vector<double> period;
  const RunningMultisine running = begun(kOnLoad, 70, 0.0);
  for (Tick tick = 70; tick < 470; ++tick)
    period.push_back(value_at(running, tick));
  const LineList lines = lines_of(kLines);
  ASSERT_EQ(lines.count, 11U);  // 2 3 5 8 12 18 27 41 62 93 140
  EXPECT_EQ(lines.multiple[10], 140U);
  for (std::uint64_t n = 1; n < 200; ++n) {
    const bool is_line =
        std::find(lines.multiple.begin(), lines.multiple.begin() + 11, n) != lines.multiple.begin() + 11;
    EXPECT_NEAR(amplitude_of(period, n), is_line ? 0.01 : 0.0, 1e-15) << n;
  }
  EXPECT_LT(*std::max_element(period.begin(), period.end()), 0.01 * 2.5 * std::sqrt(11.0));
  EXPECT_EQ(value_at(running, 75), value_at(running, 475));
}

// Catches: a begin or an end that is a tick off, a load that is lost behind it.
TEST(Multisine, StandsOnTheLoadInForceAndLeavesItAsItWas) {
  Bench bench(servo_setup());
  bench.submit(at(5, LoadChange{0.2, 0}));
  bench.submit(at(10, kOnLoad));
  step(bench, 10);
  EXPECT_EQ(bench.sample(0).load_nm, 0.2);
  for (Tick tick = 10; tick < 810; ++tick) {
    bench.step();
    ASSERT_EQ(bench.sample(0).load_nm, value_at(begun(kOnLoad, 10, 0.2), tick)) << tick;
  }
  bench.step();
  EXPECT_EQ(bench.sample(0).load_nm, 0.2);
}

// Catches: an offset that does not reach the converter; a load or a fault that waits for the end of the
// multisine.
TEST(Multisine, OnTheCurrentSensorsEndsWithTheNextOffset) {
  Bench bench(servo_setup());
  Multisine multisine = kOnLoad;
  multisine.quantity = Multisine::Quantity::kCurrentOffset;
  bench.submit(at(0, multisine));
  step(bench, 8);
  EXPECT_EQ(bench.sample(0).i_a_a - bench.sample(0).true_i_a_a, value_at(begun(multisine, 0, 0.0), 7));
  bench.submit(at(8, fault_of("current_sensor_offset", 0.5)));
  bench.step();
  EXPECT_EQ(bench.sample(0).i_a_a - bench.sample(0).true_i_a_a, 0.5);
  bench.submit(at(9, kOnLoad));
  step(bench, 3);
  bench.submit(at(12, LoadChange{0.25, 0}));
  step(bench, 4);
  EXPECT_EQ(bench.sample(0).load_nm, 0.25);
}

// Catches: a second multisine that stands on a value of the first.
TEST(Multisine, ASecondOneStandsOnWhatTheFirstStoodOn) {
  Bench bench(servo_setup());
  bench.submit(at(0, LoadChange{0.2, 0}));
  bench.submit(at(1, kOnLoad));
  step(bench, 30);
  bench.submit(at(30, kOnLoad));
  bench.step();
  EXPECT_EQ(bench.sample(0).load_nm, value_at(begun(kOnLoad, 30, 0.2), 30));
}

// Catches: lines that a period has no samples for, in a recording that came from elsewhere.
TEST(Multisine, IsRefusedWhereItIsImpossible) {
  Bench bench(servo_setup());
  const auto answer = [&bench](auto change) {
    Multisine multisine = kOnLoad;
    change(multisine);
    return bench.submit(at(0, multisine));
  };
  EXPECT_EQ(answer([](Multisine&) {}), Refused::kNot);
  EXPECT_EQ(answer([](Multisine& m) { m.amplitude = std::nan(""); }), Refused::kNotFinite);
  EXPECT_EQ(answer([](Multisine& m) { m.amplitude = 2e4; }), Refused::kOutOfRange);
  EXPECT_EQ(answer([](Multisine& m) { m.periods = 0; }), Refused::kOutOfRange);
  EXPECT_EQ(answer([](Multisine& m) { m.lines.period_ticks = 0; }), Refused::kOutOfRange);
  EXPECT_EQ(answer([](Multisine& m) { m.lines.highest = 200; }), Refused::kOutOfRange);
  EXPECT_EQ(answer([](Multisine& m) { m.lines.ratio = 1.01; }), Refused::kOutOfRange);  // too many lines
  EXPECT_EQ(answer([](Multisine& m) { m.quantity = static_cast<Multisine::Quantity>(2); }),
            Refused::kOutOfRange);
}

// Catches: a saved state without the multisine that was on its way, and bytes that a tick cannot go on from.
TEST(Multisine, GoesOnInARestoredState) {
  const Multisine multisine = kOnLoad;
  Bench bench(servo_setup());
  bench.submit(at(0, multisine));
  step(bench, 30);
  Bench other(servo_setup());
  ASSERT_TRUE(other.restore(bench.save()));
  step(bench, 900);
  step(other, 900);
  EXPECT_EQ(other.state_hash(), bench.state_hash());
  RunningMultisine running = begun(multisine, 0, 0.0);
  EXPECT_TRUE(is_possible(running));
  running.lowest = 0;
  EXPECT_FALSE(is_possible(running));
}

}  // namespace
}  // namespace drivebench::multisine_test
