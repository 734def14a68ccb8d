// The event that ends a piece.
#include "plant/train/events.hpp"

#include <gtest/gtest.h>

namespace drivebench::events_test {
namespace {

EventValues values_of(double first, double second) {
  EventValues values;
  values.add(first);
  values.add(second);
  return values;
}

/// The event of two values that go so over a piece, and how often they were asked for.
struct Located {
  Crossing crossing;
  int asked = 0;
  double last_part = 1.0;

  template <class ValuesAt>
  explicit Located(const ValuesAt& values_at) {
    crossing = located_event(values_at(0.0), values_at(1.0), [&](double part) {
      ++asked;
      last_part = part;
      return values_at(part);
    });
  }
};

// The second value falls below zero at 0.5 and comes nearly back: straight from end to end it would pass zero
// at 0.95, behind the first one at 0.9. Catches: an event that is stepped over because its value bends.
TEST(Events, OneThatBendsIsNotSteppedOver) {
  const Located found([](double part) {
    const double bent = (0.5 - part) * (2.0 - 1.9 * part);
    return values_of(0.9 - part, bent);
  });
  EXPECT_EQ(found.crossing.event, 1);
  EXPECT_NEAR(found.crossing.fraction, 0.5, 1e-12);
  EXPECT_EQ(found.last_part, found.crossing.fraction) << "the last values are those of the result";
}

// The currents of the last two terminals of a star are opposite and die at once; where they are found,
// rounding has left both a little behind zero. Catches: the second one taken for an earlier event, and a step
// that is taken once more for it.
TEST(Events, TwoAtOneInstantAreOne) {
  const Located found([](double part) {
    const double current = 0.7 - part - (part > 0.0 ? 1e-14 : 0.0);
    return values_of(current, -current);
  });
  EXPECT_NEAR(found.crossing.fraction, 0.7, 1e-13);
  EXPECT_EQ(found.asked, 1);
}

// Catches: a value that begins or stays at zero, or that does not get there, taken for an event.
TEST(Events, WithoutAPassageThroughZeroThereIsNone) {
  const Located found([](double part) { return values_of(0.0 - part, 1.0 - part); });
  EXPECT_EQ(found.crossing.event, -1);
  EXPECT_EQ(found.crossing.fraction, 1.0);
  EXPECT_EQ(found.asked, 0);
}

}  // namespace
}  // namespace drivebench::events_test
