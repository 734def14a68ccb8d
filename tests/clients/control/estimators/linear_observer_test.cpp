#include "clients/control/estimators/linear_observer.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>

#include "clients/control/estimators/shaft_observers.hpp"

namespace drivebench::control::linear_observer_test {
namespace {

constexpr double kFriction = 4e-4 / 6e-5;
constexpr auto kAllWays = {Discretisation::kEuler, Discretisation::kTrapezoidal, Discretisation::kExact};

// Catches: a series that stops too early or a squaring too few: the exponential of a matrix with known one.
TEST(SmallMatrix, ExponentialOfADampedRotationAndOfANilpotentMatrix) {
  const Matrix<2, 2> turned = matrix_exponential(Matrix<2, 2>{{{-1.0, 20.0}, {-20.0, -1.0}}});
  EXPECT_NEAR(turned[0][0], std::exp(-1.0) * std::cos(20.0), 1e-13);
  EXPECT_NEAR(turned[0][1], std::exp(-1.0) * std::sin(20.0), 1e-13);
  const Matrix<3, 3> shifted =
      matrix_exponential(Matrix<3, 3>{{{0.0, 3.0, 0.0}, {0.0, 0.0, 4.0}, {0.0, 0.0, 0.0}}});
  EXPECT_NEAR(shifted[0][2], 6.0, 1e-13);
  EXPECT_NEAR(shifted[1][2], 4.0, 1e-13);
}

// Catches: an elimination without pivoting and a wrong sign in the recursion for the polynomial.
TEST(SmallMatrix, SolvesAndHasItsCharacteristicPolynomial) {
  const Matrix<3, 3> a = {{{0.0, 2.0, 1.0}, {1.0, 0.0, 3.0}, {2.0, 1.0, 0.0}}};
  const Matrix<3, 1> b = {{{7.0}, {10.0}, {4.0}}};
  const Matrix<3, 1> x = solved(a, b);
  EXPECT_NEAR(x[0][0], 1.0, 1e-14);
  EXPECT_NEAR(x[1][0], 2.0, 1e-14);
  EXPECT_NEAR(x[2][0], 3.0, 1e-14);
  const Polynomial<3> c = characteristic_polynomial(a);  // s^3 - 7 s - 13
  EXPECT_NEAR(c[0], 0.0, 1e-14);
  EXPECT_NEAR(c[1], -7.0, 1e-14);
  EXPECT_NEAR(c[2], -13.0, 1e-14);
}

// AC-06. Catches: a discretisation under another's name: p = 500 at 0.5 ms goes to 0.75, 0.77778 and e^-0.25,
// double, so the polynomial is (z - that)^2.
TEST(LinearObserver, EachDiscretisationPlacesItsPoles) {
  const auto gains = ShaftObserverGains::placed(std::array{500.0, 500.0}, kFriction);
  EXPECT_NEAR(gains.angle_per_s, 993.3333, 1e-4);
  EXPECT_NEAR(gains.speed_per_s2, 243377.78, 0.01);
  const double expected[] = {0.75, 1.75 / 2.25, std::exp(-0.25)};
  std::size_t k = 0;
  for (const Discretisation how : kAllWays) {
    const LinearObserver<2, 1> observer(shaft_observer(gains, kFriction), 0.5e-3, how);
    const Polynomial<2> c = characteristic_polynomial(observer.transition());
    EXPECT_NEAR(c[0], -2.0 * expected[k], 1e-12);
    EXPECT_NEAR(c[1], expected[k] * expected[k], 1e-12);
    EXPECT_TRUE(observer.stable());
    ++k;
  }
}

// Catches: a stability report that looks at the continuous observer: Euler is stable for pT < 2 alone.
TEST(LinearObserver, EulerLosesAFastPoleAndTheOthersDoNot) {
  const auto gains = ShaftObserverGains::placed(std::array{500.0, 500.0}, kFriction);
  const LinearSystem<2, 1> system = shaft_observer(gains, kFriction);
  EXPECT_TRUE(system.stable());
  EXPECT_TRUE((LinearObserver<2, 1>(system, 3.9e-3, Discretisation::kEuler).stable()));
  EXPECT_FALSE((LinearObserver<2, 1>(system, 4.1e-3, Discretisation::kEuler).stable()));
  EXPECT_TRUE((LinearObserver<2, 1>(system, 4.1e-3, Discretisation::kTrapezoidal).stable()));
  EXPECT_TRUE((LinearObserver<2, 1>(system, 4.1e-3, Discretisation::kExact).stable()));
}

/// θ = 50 t: constant speed, which takes f·ω of torque.
LinearObserver<2, 1> after_constant_speed(Discretisation how, std::int64_t periods, int samples) {
  const auto gains = ShaftObserverGains::placed(std::array{500.0, 500.0}, kFriction);
  LinearObserver<2, 1> observer(shaft_observer(gains, kFriction), 0.5e-3, how);
  for (int k = 0; k < samples; ++k)
    observer.update({kFriction * 50.0}, 50.0 * 0.5e-3 * static_cast<double>(periods) * k, periods);
  return observer;
}

// Catches: an injection or an input that is off by a sample: at constant speed no way may have an error, with
// samples lost or without.
TEST(LinearObserver, ConstantSpeedLeavesNoError) {
  for (const Discretisation how : kAllWays) {
    for (const std::int64_t periods : {1, 3}) {
      const auto observer = after_constant_speed(how, periods, 200);
      EXPECT_NEAR(observer.state()[0], 50.0 * 0.5e-3 * static_cast<double>(periods) * 199, 1e-9);
      EXPECT_NEAR(observer.state()[1], 50.0, 1e-9);
    }
  }
}

// Catches: a gap that is bridged without its inputs: three steps at once are three steps on a line.
TEST(LinearObserver, LostSamplesArePutOnALine) {
  const auto gains = ShaftObserverGains::placed(std::array{300.0, 400.0}, kFriction);
  for (const Discretisation how : kAllWays) {
    LinearObserver<2, 1> at_once(shaft_observer(gains, kFriction), 0.5e-3, how);
    LinearObserver<2, 1> one_by_one = at_once;
    at_once.update({10.0}, 0.1, 1);
    one_by_one.update({10.0}, 0.1, 1);
    at_once.update({40.0}, 0.7, 3);
    for (const double share : {1.0 / 3.0, 2.0 / 3.0, 1.0})
      one_by_one.update({10.0 + 30.0 * share}, 0.1 + 0.6 * share, 1);
    EXPECT_NEAR(at_once.state()[0], one_by_one.state()[0], 1e-12);
    EXPECT_NEAR(at_once.state()[1], one_by_one.state()[1], 1e-9);
  }
}

// EST-04. Catches: a claim that the position can be seen from the speed: its error stays for ever, whatever
// the gains, and nothing but the exact way could even notice.
TEST(LinearObserver, ThePositionCannotBeObservedFromTheSpeed) {
  for (const Discretisation how : kAllWays) {
    const LinearSystem<2, 1> system = {.a = {{{0.0, 1.0}, {0.0, -kFriction}}},
                                       .b = {{{0.0}, {1.0}}},
                                       .c = {{{0.0, 1.0}}},
                                       .l = {{{200.0}, {300.0}}}};
    EXPECT_FALSE(system.stable());
    LinearObserver<2, 1> observer(system, 0.5e-3, how);
    EXPECT_FALSE(observer.stable());
    observer.reset({0.1, 0.0});
    for (int k = 0; k < 2000; ++k)
      observer.update({0.0}, 0.0, 1);
    EXPECT_EQ(observer.state()[0], 0.1);
    EXPECT_EQ(observer.state()[1], 0.0);
  }
}

}  // namespace
}  // namespace drivebench::control::linear_observer_test
