#include "plant/math/frames.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace drivebench::frames_test {
namespace {

constexpr double kThirdTurn_rad = 0x1.0c152382d7366p+1;  // 2 pi/3

ThreePhase balanced(double peak, double angle_rad) {
  return {.a = peak * cosine(angle_rad),
          .b = peak * cosine(angle_rad - kThirdTurn_rad),
          .c = peak * cosine(angle_rad + kThirdTurn_rad)};
}

double draw(std::mt19937_64& engine) {
  return std::uniform_real_distribution<double>(-300.0, 300.0)(engine);
}

// AC-21 of the reference. Catches: the amplitude-invariant factor 2/3 in place of sqrt(2/3), a zero sequence
// that leaks.
TEST(Frames, OneHundredVoltsOnPhaseAGiveTheReferenceValues) {
  constexpr ThreePhase kVoltage{.a = 100.0, .b = 0.0, .c = 0.0};
  const TwoPhase two = three_to_two(kVoltage);
  EXPECT_NEAR(two.a, 81.6496580927726, 1e-12);
  EXPECT_EQ(two.b, 0.0);
  EXPECT_NEAR(neutral(kVoltage), 33.3333333333333, 1e-12);
  EXPECT_NEAR(std::sqrt(3.0) * neutral(kVoltage), 57.735, 1e-3);
  const ThreePhase motor = without_neutral(kVoltage);
  EXPECT_NEAR(motor.a, 66.6666666666667, 1e-12);
  EXPECT_NEAR(motor.b, -33.3333333333333, 1e-12);
  EXPECT_NEAR(motor.c, -33.3333333333333, 1e-12);
}

// AC-21. Catches: any other amplitude relation than sqrt(3/2).
TEST(Frames, TwoHundredEightVoltsLineToLineAreTwoHundredEightVoltsTwoPhasePeak) {
  const double phase_peak = 208.0 * std::sqrt(2.0 / 3.0);
  EXPECT_NEAR(phase_peak, 169.831, 1e-3);
  for (const double angle_rad : {0.0, 0.4, 1.9, 3.3, 5.8}) {
    const TwoPhase two = three_to_two(balanced(phase_peak, angle_rad));
    EXPECT_NEAR(std::hypot(two.a, two.b), 208.0, 1e-12 * 208.0);
  }
}

// Catches: phases b and c exchanged: the machine would turn backwards.
TEST(Frames, TheSequenceABCTurnsFromPhaseATowardsPhaseB) {
  for (const double angle_rad : {0.1, 1.3, 2.9, -0.7, -2.2}) {
    const TwoPhase two = three_to_two(balanced(10.0, angle_rad));
    EXPECT_NEAR(arctangent2(two.b, two.a), angle_rad, 1e-14);
  }
}

// Catches: a transform that is not orthogonal, in one direction or in both.
TEST(Frames, PowerIsTheSameInThreeAndTwoPhasesAndInATurningFrame) {
  std::mt19937_64 engine(7);
  for (int i = 0; i < 1000; ++i) {
    const ThreePhase u{.a = draw(engine), .b = draw(engine), .c = draw(engine)};
    const ThreePhase i3 = without_neutral({.a = draw(engine), .b = draw(engine), .c = draw(engine)});  // star
    const double power = u.a * i3.a + u.b * i3.b + u.c * i3.c;
    const TwoPhase u2 = three_to_two(u);
    const TwoPhase i2 = three_to_two(i3);
    EXPECT_NEAR(u2.a * i2.a + u2.b * i2.b, power, 1e-9);  // 1e5 V·A in double: 1e-11 each
    const CosSin angle = cos_sin(draw(engine));
    const Dq u_dq = to_dq(u2, angle);
    const Dq i_dq = to_dq(i2, angle);
    EXPECT_NEAR(u_dq.d * i_dq.d + u_dq.q * i_dq.q, power, 1e-9);
  }
}

// Catches: a wrong sign or factor in one of a pair of inverses.
TEST(Frames, EveryTransformIsUndoneByItsInverse) {
  std::mt19937_64 engine(8);
  for (int i = 0; i < 1000; ++i) {
    const TwoPhase two{.a = draw(engine), .b = draw(engine)};
    const ThreePhase three = two_to_three(two);
    EXPECT_NEAR(three.a + three.b + three.c, 0.0, 1e-12);
    const TwoPhase again = three_to_two(three);
    EXPECT_NEAR(again.a, two.a, 1e-12);
    EXPECT_NEAR(again.b, two.b, 1e-12);
    const CosSin angle = cos_sin(draw(engine));
    const TwoPhase back = to_ab(to_dq(two, angle), angle);
    EXPECT_NEAR(back.a, two.a, 1e-12);
    EXPECT_NEAR(back.b, two.b, 1e-12);
    const ThreePhase u{.a = draw(engine), .b = draw(engine), .c = draw(engine)};
    const ThreePhase star = two_to_three(three_to_two(u));
    EXPECT_NEAR(star.a, without_neutral(u).a, 1e-12);
    EXPECT_NEAR(star.b, without_neutral(u).b, 1e-12);
    EXPECT_NEAR(star.c, without_neutral(u).c, 1e-12);
  }
}

// Catches: a rotation the wrong way round (a round trip would not notice).
TEST(Frames, AVectorAheadOfTheFrameHasAPositiveQ) {
  const Dq ahead = to_dq({.a = cosine(1.1), .b = sine(1.1)}, cos_sin(0.8));
  EXPECT_NEAR(ahead.d, cosine(0.3), 1e-15);
  EXPECT_NEAR(ahead.q, sine(0.3), 1e-15);
  const TwoPhase along_q = to_ab({.d = 0.0, .q = 1.0}, cos_sin(0.8));
  EXPECT_NEAR(along_q.a, -sine(0.8), 1e-15);
  EXPECT_NEAR(along_q.b, cosine(0.8), 1e-15);
}

// Catches: mixed-up factors. Vector P3-01 of the reference: i = (3, -1, -2) A.
TEST(Frames, TheReferenceCurrentVectorIsReproduced) {
  const TwoPhase two = three_to_two({.a = 3.0, .b = -1.0, .c = -2.0});
  EXPECT_NEAR(two.a, 3.674235, 1e-6);
  EXPECT_NEAR(two.b, 0.707107, 1e-6);
}

}  // namespace
}  // namespace drivebench::frames_test
