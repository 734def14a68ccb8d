#include "plant/math/noise.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <vector>

namespace drivebench::noise_test {
namespace {

constexpr std::uint64_t kCount = 400'000;
constexpr std::uint64_t kEverything = ~std::uint64_t{0};

/// Correlation coefficient of two series of zero-mean, unit-variance numbers.
template <typename First, typename Second>
double correlation(First first, Second second) {
  double sum = 0.0;
  for (std::uint64_t tick = 0; tick < kCount; ++tick)
    sum += first(tick) * second(tick);
  return sum / static_cast<double>(kCount);
}

// Catches: a wrong scale in Box-Muller (variance), an angle or radius of a wrong law (skewness, kurtosis).
// The tolerances are five standard errors: 1/sqrt(n) times 1, sqrt(2), sqrt(15) (raw third moment) and
// sqrt(96).
TEST(Noise, GaussianHasTheMomentsOfTheNormalLaw) {
  double sum = 0.0;
  double squares = 0.0;
  double cubes = 0.0;
  double fourths = 0.0;
  for (std::uint64_t tick = 0; tick < kCount; ++tick) {
    const double x = gaussian_noise(11, 3, tick);
    sum += x;
    squares += x * x;
    cubes += x * x * x;
    fourths += x * x * x * x;
  }
  const double n = static_cast<double>(kCount);
  const double error = 5.0 / std::sqrt(n);
  EXPECT_NEAR(sum / n, 0.0, error);
  EXPECT_NEAR(squares / n, 1.0, error * std::sqrt(2.0));
  EXPECT_NEAR(cubes / n, 0.0, error * std::sqrt(15.0));
  EXPECT_NEAR(fourths / n, 3.0, error * std::sqrt(96.0));
}

// Catches: right moments with a wrong shape, for example tails cut off. Kolmogorov-Smirnov at the 1e-6
// level: 2.69/sqrt(n).
TEST(Noise, GaussianFollowsTheNormalDistributionFunction) {
  std::vector<double> values(kCount);
  for (std::uint64_t tick = 0; tick < kCount; ++tick)
    values[tick] = gaussian_noise(5, 0, tick);
  std::sort(values.begin(), values.end());
  double largest_gap = 0.0;
  for (std::uint64_t i = 0; i < kCount; ++i) {
    const double expected = 0.5 * std::erfc(-values[i] / std::sqrt(2.0));
    largest_gap = std::max(
        largest_gap, std::fabs(expected - (static_cast<double>(i) + 0.5) / static_cast<double>(kCount)));
  }
  EXPECT_LT(largest_gap, 2.69 / std::sqrt(static_cast<double>(kCount)));
  EXPECT_GT(values.back(), 4.0);  // 12 values beyond 4 are expected on each side
  EXPECT_LT(values.front(), -4.0);
}

// Catches: bits of the word that are used twice or not at all. Chi-square, 255 degrees of freedom, 6 standard
// deviations.
TEST(Noise, UniformFillsTheUnitIntervalEvenly) {
  std::array<double, 256> coarse{};
  std::array<double, 256> fine{};
  for (std::uint64_t tick = 0; tick < kCount; ++tick) {
    const double u = uniform_noise(2, 9, tick);
    ASSERT_GE(u, 0.0);
    ASSERT_LT(u, 1.0);
    coarse[static_cast<std::size_t>(u * 256.0)] += 1.0;
    fine[static_cast<std::size_t>(std::fmod(u * 0x1p40, 256.0))] += 1.0;
  }
  constexpr double kExpected = static_cast<double>(kCount) / 256.0;
  for (const auto& counts : {coarse, fine}) {
    double chi_square = 0.0;
    for (const double count : counts)
      chi_square += (count - kExpected) * (count - kExpected) / kExpected;
    EXPECT_NEAR(chi_square, 255.0, 6.0 * std::sqrt(2.0 * 255.0));
  }
}

// Catches: a hash that adds its arguments, so that neighbours in seed, channel or tick repeat or shift one
// another.
TEST(Noise, NeighboursAreUncorrelated) {
  const auto base = [](std::uint64_t tick) { return gaussian_noise(100, 4, tick); };
  const double five_standard_errors = 5.0 / std::sqrt(static_cast<double>(kCount));
  EXPECT_NEAR(correlation(base, [](std::uint64_t tick) { return gaussian_noise(100, 5, tick); }), 0.0,
              five_standard_errors);
  EXPECT_NEAR(correlation(base, [](std::uint64_t tick) { return gaussian_noise(101, 4, tick); }), 0.0,
              five_standard_errors);
  EXPECT_NEAR(correlation(base, [](std::uint64_t tick) { return gaussian_noise(101, 3, tick); }), 0.0,
              five_standard_errors);
  for (const std::uint64_t lag : {1U, 2U, 64U, 1000U}) {
    EXPECT_NEAR(correlation(base, [lag](std::uint64_t tick) { return gaussian_noise(100, 4, tick + lag); }),
                0.0, five_standard_errors);
  }
}

// Catches: an argument bit that the hash drops or hardly mixes. 64 bits of difference scatter by 4 around 32.
TEST(Noise, EveryArgumentBitFlipsHalfOfTheWord) {
  for (unsigned bit = 0; bit < 64; ++bit) {
    const std::uint64_t flip = std::uint64_t{1} << bit;
    std::array<double, 3> flipped{};
    for (std::uint64_t tick = 0; tick < 256; ++tick) {
      const std::uint64_t word = NoiseChannel(1, 2).word(tick);
      flipped[0] += std::popcount(word ^ NoiseChannel(1 ^ flip, 2).word(tick));
      flipped[1] += std::popcount(word ^ NoiseChannel(1, 2 ^ flip).word(tick));
      flipped[2] += std::popcount(word ^ NoiseChannel(1, 2).word(tick ^ flip));
    }
    for (const double count : flipped)
      EXPECT_NEAR(count / 256.0, 32.0, 6.0 * 4.0 / 16.0) << "bit " << bit;
  }
}

// Catches: hidden state. A recording replayed from the middle must see the noise it saw.
TEST(Noise, ValuesDoNotDependOnTheOrderOfTheCalls) {
  std::vector<double> forward;
  for (std::uint64_t tick = 0; tick < 1000; ++tick)
    forward.push_back(gaussian_noise(8, 1, tick));
  for (std::uint64_t tick = 1000; tick-- > 0;) {
    (void)uniform_noise(8, 2, tick);  // another channel in between
    ASSERT_EQ(gaussian_noise(8, 1, tick), forward[tick]);
  }
}

// Catches: a changed constant or round. The values are part of the recording format: replay needs them for
// ever.
TEST(Noise, GivesTheSameBitsOnEveryMachine) {
  EXPECT_EQ(uniform_noise(0, 0, 0), 0x1.87b6a2ad9c72dp-1);
  EXPECT_EQ(uniform_noise(1, 0, 0), 0x1.15ac71ee0e1a2p-1);
  EXPECT_EQ(uniform_noise(0, 1, 0), 0x1.e53de38483824p-2);
  EXPECT_EQ(uniform_noise(0, 0, 1), 0x1.1d549fec9f06p-2);
  EXPECT_EQ(uniform_noise(42, 7, 123456789), 0x1.c9875a8a94bb1p-1);
  EXPECT_EQ(gaussian_noise(0, 0, 0), 0x1.20cc847230f95p-1);
  EXPECT_EQ(gaussian_noise(0, 1, 0), -0x1.781eb56dbcc57p-1);
  EXPECT_EQ(gaussian_noise(42, 7, 123456789), 0x1.69de143da26d5p-2);
  EXPECT_EQ(gaussian_noise(kEverything, kEverything, kEverything), -0x1.4ed501c42fd17p+0);
}

// Catches: the half-open interval turned round: log(0) or a uniform value of 1.
TEST(Noise, TheExtremeWordsStayInTheirRange) {
  EXPECT_EQ(noise_detail::unit_interval(0), 0.0);
  EXPECT_EQ(noise_detail::unit_interval(kEverything), 1.0 - 0x1p-53);
  // The word 0 is what gaussian_noise would draw the largest magnitude from.
  EXPECT_LT(std::sqrt(-2.0 * logarithm(noise_detail::unit_interval(0) + 0x1p-53)), 8.58);
  EXPECT_EQ(logarithm(noise_detail::unit_interval(kEverything) + 0x1p-53), 0.0);
}

}  // namespace
}  // namespace drivebench::noise_test
