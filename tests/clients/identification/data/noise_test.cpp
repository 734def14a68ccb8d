#include "clients/identification/data/noise.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace drivebench::identification::noise_test {
namespace {

/// A sine of 100 samples with an edge, and noise of this rms.
Series signal(double rms) {
  std::mt19937_64 engine(1);
  std::normal_distribution<double> noise;
  Series x;
  for (int k = 0; k < 4000; ++k)
    x.push_back(std::sin(0.0628 * k) + (k > 2000 ? 5.0 : 0.0) + rms * noise(engine));
  return x;
}

// The noise of a signal to 5 %, an edge of 500 times its size notwithstanding. Catches: an rms in the place
// of the median, a factor of the differences.
TEST(WhiteNoise, IsToldFromTheSignalAndItsEdges) {
  EXPECT_NEAR(white_noise(signal(0.01)), 0.01, 5e-4);
}

// A converter without noise has the noise of its steps, 1/sqrt(12) and up to twice that where few samples
// share a step; a signal without steps has none. Catches: a noise of zero, which no model can meet, and steps
// seen in a smooth signal.
TEST(WhiteNoise, OfAConverterIsThatOfItsSteps) {
  Series x = signal(0.0);
  EXPECT_LT(white_noise(x), 1e-4);
  for (double& value : x)
    value = 0.1 * std::round(value / 0.1);
  EXPECT_GE(white_noise(x), 0.099 / std::sqrt(12.0));
  EXPECT_LE(white_noise(x), 0.2 / std::sqrt(12.0));
}

}  // namespace
}  // namespace drivebench::identification::noise_test
