// The search for a zero between two points.
#include "plant/math/bracket.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace drivebench::bracket_test {
namespace {

/// The guesses, none beyond the ends, until the value is below 1e-13 of those there or nothing is between
/// them.
template <class F>
int guesses(const F& f) {
  Bracket bracket{.low_value = f(0.0), .high_value = f(1.0)};
  const double close_enough = 1e-13 * (std::abs(bracket.low_value) + std::abs(bracket.high_value));
  for (int n = 1; n < 100; ++n) {
    const double at = bracket.guess();
    EXPECT_GE(at, bracket.low);
    EXPECT_LE(at, bracket.high);
    const double value = f(at);
    if (std::abs(value) <= close_enough || bracket.high - bracket.low < 1e-15) return n;
    bracket.narrow(at, value);
  }
  return 100;
}

// A current that dies in a piece as long as a tenth of its time constant, anywhere in it: 3 guesses nearly
// everywhere; chords alone need 5.
// Catches: a parabola through the wrong point, which is not nearer than a chord.
TEST(Bracket, ANearlyStraightLineNeedsFourGuessesAtMost) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> place(0.001, 0.999);
  int most = 0;
  for (int n = 0; n < 1000; ++n) {
    const double end = std::exp(-0.1 * place(random));
    most = std::max(most, guesses([end](double t) { return std::exp(-0.1 * t) - end; }));
  }
  EXPECT_LE(most, 4);
}

// Exponentials that are over at once, roots with an infinite slope, flat ones, bends: of either sign.
// Catches: a guess outside of the ends, an end that stays for ever, a division by nothing.
TEST(Bracket, BentLinesAreFoundToo) {
  std::mt19937_64 random(6);
  std::uniform_real_distribution<double> place(0.02, 0.98);
  int most = 0;
  for (int n = 0; n < 1000; ++n) {
    const double x = place(random);
    const double sign = n % 2 == 0 ? 1.0 : -1.0;
    const double end = std::exp(-30.0 * x);
    most = std::max(most, guesses([=](double t) { return sign * (std::exp(-30.0 * t) - end); }));
    most = std::max(most, guesses([=](double t) { return sign * std::cbrt(t - x); }));
    most = std::max(most, guesses([=](double t) { return sign * (t - x) * (t - x) * (t - x); }));
    most = std::max(most,
                    guesses([=](double t) { return sign * (std::tanh(40.0 * (t - x)) + 1e-3 * (t - x)); }));
  }
  EXPECT_LE(most, 60);
}

}  // namespace
}  // namespace drivebench::bracket_test
