#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "clients/regression/checks/harmonics.hpp"
#include "tests/clients/regression/check_on_course.hpp"

namespace drivebench::regression::spectrum_test {
namespace {

/// A square wave as the sum of its harmonics up to one, so that none is folded back by the samples; on a
/// mean.
double square_wave(double turns, int last) {
  double value = 3.0;
  for (int n = 1; n <= last; n += 2)
    value += 4.0 / std::numbers::pi / n * std::sin(2.0 * std::numbers::pi * n * turns + 0.3 * n);
  return value;
}

/// sqrt(1/9 + 1/25 + ...) up to a harmonic, as percent; 48.34 % for all of them: sqrt(pi²/8 - 1).
double square_wave_thd(int last) {
  double sum = 0.0;
  for (int n = 3; n <= last; n += 2)
    sum += std::pow(n, -2.0);
  return 100.0 * std::sqrt(sum);
}

Course square_course(double frequency_hz, int last) {
  return {.speed = [=](std::uint64_t tick) {
    return square_wave(frequency_hz * kPeriod_s * static_cast<double>(tick), last);
  }};
}

// Catches: a mean that counts as a harmonic, amplitudes mixed by a window of no whole periods.
TEST(Harmonics, OfASquareWaveAreThoseOfItsSeries) {
  std::vector<double> values;
  values.reserve(3777);
  for (int k = 0; k < 3777; ++k)
    values.push_back(square_wave(0.00123456 * k, 99));
  const std::vector<double> amplitudes = harmonic_amplitudes(values, 0.00123456, 99);
  ASSERT_EQ(amplitudes.size(), 100u);
  EXPECT_NEAR(amplitudes[0], 3.0, 1e-9);
  for (std::size_t n = 1; n < amplitudes.size(); ++n)
    EXPECT_NEAR(amplitudes[n], n % 2 == 1 ? 4.0 / std::numbers::pi / static_cast<double>(n) : 0.0, 1e-9) << n;
}

// Catches: a fundamental that noise or ripple on the signal makes a multiple of itself. Noise of 0.1 leaves
// the best estimator a deviation of sqrt(6) · 0.1 / (pi · 1.27 · 3000^1.5) = 3.7e-7, and the Hann window
// twice that; the limit is three of those.
TEST(Harmonics, TheFundamentalIsFoundInNoise) {
  std::mt19937_64 engine(3);
  std::normal_distribution<double> noise(0.0, 0.1);
  for (const double frequency : {0.0041, 0.00777, 0.0123}) {
    std::vector<double> values;
    values.reserve(3000);
    for (int k = 0; k < 3000; ++k)
      values.push_back(square_wave(frequency * k, 1) + noise(engine));
    const auto found = fundamental_of(values);
    ASSERT_TRUE(found.has_value());
    EXPECT_NEAR(*found, frequency, 2.4e-6);
  }
  EXPECT_FALSE(fundamental_of(std::vector<double>(100, 1.0)).has_value());
}

// Catches: distortion over all instead of over the fundamental, its square, or the fundamental counted with
// the harmonics. A sampled square wave up to harmonic 99 has 47.82 %.
TEST(Checks, ThdOfASquareWaveIsItsClosedForm) {
  const Course course = square_course(3.217, 99);
  const Finding given =
      found(speed_check("thd", "max_percent = 47.9\nfundamental_hz = 3.217\nharmonics = 99"), course, 2000);
  EXPECT_TRUE(given.passed) << given.sentence;
  EXPECT_NEAR(given.measured, square_wave_thd(99), 1e-6);
  EXPECT_NEAR(square_wave_thd(99'999), 100.0 * std::sqrt(std::pow(std::numbers::pi, 2) / 8.0 - 1.0), 1e-3);
  const Finding forty =
      found(speed_check("thd", "max_percent = 47\nfundamental_hz = 3.217"), square_course(3.217, 39), 2000);
  EXPECT_FALSE(forty.passed);
  EXPECT_NEAR(forty.measured, square_wave_thd(39), 1e-6);
  EXPECT_EQ(forty.unit, "%");
  EXPECT_NE(forty.sentence.find("thd 47.0"), std::string::npos) << forty.sentence;
  const Finding itself = found(speed_check("thd", "max_percent = 50"), square_course(5.31, 39), 2000);
  EXPECT_TRUE(itself.passed) << itself.sentence;
  EXPECT_NEAR(itself.measured, square_wave_thd(39), 0.05);
}

// Catches: a signal at rest, or one with less than a few periods, that passes.
TEST(Checks, ThdWithoutAFundamentalFails) {
  const Finding rest = found(speed_check("thd", "max_percent = 99"), {});
  EXPECT_FALSE(rest.passed);
  EXPECT_EQ(rest.sentence, "no fundamental: the signal does not rise twice");
  const Finding few = found(speed_check("thd", "max_percent = 99\nharmonics = 5"), square_course(50.0, 5));
  EXPECT_FALSE(few.passed);
  EXPECT_NE(few.sentence.find("periods of 50"), std::string::npos) << few.sentence;
  const Finding given = found(speed_check("thd", "max_percent = 99\nfundamental_hz = 40\nharmonics = 5"), {});
  EXPECT_FALSE(given.passed);
  EXPECT_EQ(given.sentence, "no fundamental: its amplitude is 0");
}

// Catches: a check that cannot work, told only after the run or not at all.
TEST(Checks, ThdThatCannotBeIsRefusedBeforeTheRun) {
  const auto on_bench = [](const std::string& keys, std::uint64_t end_tick) {
    std::string problem;
    const auto spec = spec_of(speed_check("thd", "max_percent = 5\n" + keys), problem);
    return spec ? problem_on_bench(*spec, facts_to(end_tick)) : problem;
  };
  EXPECT_EQ(on_bench("fundamental_hz = 5", 499), "has a window of 2.5 periods of 5 Hz but must have 3");
  EXPECT_EQ(on_bench("fundamental_hz = 5\nto_s = 0.5", 5000),
            "has a window of 2.5 periods of 5 Hz but must have 3");
  EXPECT_EQ(on_bench("fundamental_hz = 20", 5000),
            "has 50 samples in a period of 20 Hz, too few for 40 harmonics");
  EXPECT_EQ(on_bench("fundamental_hz = 20\nharmonics = 24", 5000), "");
  EXPECT_EQ(on_bench("", RunFacts{}.end_tick), "needs to_s, because the case has no duration_s");
  EXPECT_EQ(on_bench("", 2'000'000), "has a window of 2000001 samples but 1000000 are the most");
  EXPECT_NE(problem_of_check(speed_check("thd", "")).find("max_percent"), std::string::npos);
  EXPECT_NE(problem_of_check(speed_check("thd", "max_percent = 5\nharmonics = 2.5"))
                .find("has harmonics that are no whole number"),
            std::string::npos);
  EXPECT_NE(problem_of_check(speed_check("thd", "max_percent = 5\nharmonics = 101")).find("harmonics"),
            std::string::npos);
}

}  // namespace
}  // namespace drivebench::regression::spectrum_test
