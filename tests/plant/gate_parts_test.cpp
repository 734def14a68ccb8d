// The parts of a tick at gate level: over changes of legs that move no voltage they go on.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <random>

#include "plant/gate_axis.hpp"
#include "tests/plant/gate_course.hpp"

namespace drivebench::gate_parts_test {
namespace {

using namespace gate_course;

/// On a stiff link, and heavy: what it does then hangs on its start for ever, and not on last digits.
AxisParameters heavy_motor() {
  AxisParameters p = turning_motor();
  p.mechanics.inertia_kgm2 = 1e-4;
  p.drive.bus = {.voltage_v = p.drive.bus.voltage_v};
  return p;
}

constexpr auto kAnyState = [](const AxisState&) noexcept { return true; };

/// With a limit of the bootstrap that it never meets: its parts end at each change of a leg.
AxisParameters with_single_parts(AxisParameters p) {
  p.drive.inverter.bootstrap_s = 1e3;
  p.drive.inverter.bootstrap_recharge_s = 1e-3;
  return p;
}

/// A course with joined parts, and the same with single ones.
struct Pair {
  GateCourse joined;
  GateCourse single;

  explicit Pair(const AxisParameters& p) : joined(p, 16), single(with_single_parts(p), 16) {}

  template <class Set>
  void set(Set set_axis) {
    set_axis(joined.axis);
    set_axis(single.axis);
  }
  void run(Picoseconds until) {
    joined.run(until, 64);
    single.run(until, 64);
  }
};

// Random settings of the legs: PWM with dead times from 0.1 to 4 us, at currents of both signs that die and
// come back. Catches: a leg that is held beyond the death of its current, a timer whose dead time counts from
// another change, a rail on the wrong side, a saved state that is refused.
TEST(GateParts, JoinedPartsAreAsGoodAsSingleOnes) {
  for (unsigned seed = 0; seed < 5; ++seed) {
    Pair pair(heavy_motor());
    std::mt19937_64 random(seed);
    const auto between = [&random](double from, double to) {
      return from + (to - from) * static_cast<double>(random() % 1024) / 1024.0;
    };
    double most_a = 0.0;
    for (int n = 0; n < 200; ++n) {
      const auto leg = static_cast<std::size_t>(random() % 3);
      LegSetting setting = pwm(between(0.02, 0.5), static_cast<Picoseconds>(between(15e6, 40e6)),
                               static_cast<Picoseconds>(between(0.1e6, 4e6)));
      setting.mode = static_cast<LegMode>(random() % 6);
      setting.centred = static_cast<std::uint32_t>(random() % 2);
      pair.set([&](GateAxis& axis) { axis.set_leg(leg, setting); });
      pair.run(pair.joined.axis.now() + static_cast<Picoseconds>(between(1e6, 200e6)));
      ASSERT_TRUE(pair.joined.axis.restore(pair.joined.axis.save(), kAnyState)) << seed << " " << n;
      const GateAxis::Now a = pair.joined.axis.look();
      const GateAxis::Now b = pair.single.axis.look();
      most_a = std::max(most_a, std::abs(a.truth.current_a.a));
      // Up to 100 A, which the integration gives to 1e-9 of the change; a picosecond of dead time is 1e-6 A.
      ASSERT_NEAR(a.truth.current_a.a, b.truth.current_a.a, 1e-8) << seed << " " << n;
      ASSERT_NEAR(a.truth.current_a.b, b.truth.current_a.b, 1e-8) << seed << " " << n;
      ASSERT_NEAR(a.state.shaft.speed_rad_s, b.state.shaft.speed_rad_s, 1e-9) << seed << " " << n;
      ASSERT_NEAR(a.sums.terminal_vs.a, b.sums.terminal_vs.a, 1e-10) << seed << " " << n;
      ASSERT_NEAR(a.sums.link_j, b.sums.link_j, 1e-10) << seed << " " << n;
      ASSERT_EQ(a.levels, b.levels) << seed << " " << n;
      ASSERT_EQ(a.state.open_terminals, b.state.open_terminals) << seed << " " << n;
    }
    EXPECT_GT(most_a, 5.0);
    EXPECT_NE(pair.joined.axis.look().sums.link_j, pair.single.axis.look().sums.link_j)
        << "no part was joined";
  }
}

// Catches: dead time beside a diode that is still taken for a closed switch when the diode takes a voltage.
TEST(GateParts, DiodesThatGetAVoltageDivideThem) {
  AxisParameters p = heavy_motor();
  Pair pair(p);
  pair.set([](GateAxis& axis) {
    axis.set_leg(0, pwm(0.4, 20 * kMicro, 2 * kMicro));
    axis.set_leg(1, {.mode = LegMode::kLow});
  });
  pair.run(200 * kMicro);
  p.drive.inverter.diode_v = 1.0;
  pair.joined.axis.set_parameters(p);
  pair.single.axis.set_parameters(with_single_parts(p));
  pair.run(400 * kMicro);
  EXPECT_GT(pair.single.axis.look().truth.current_a.a, 5.0);
  EXPECT_NEAR(pair.joined.axis.look().truth.current_a.a, pair.single.axis.look().truth.current_a.a, 1e-8);
}

// A link with R C = 15 us is taken in its mean over each piece: longer pieces err more. Catches: a link that
// does not see the current of a joined leg.
TEST(GateParts, ABatteryFeedsJoinedLegs) {
  AxisParameters p = turning_motor();
  p.mechanics.inertia_kgm2 = 1e-4;
  Pair pair(p);
  pair.set([](GateAxis& axis) {
    axis.set_leg(0, pwm(0.4, 20 * kMicro, 2 * kMicro));
    axis.set_leg(1, {.mode = LegMode::kLow});
  });
  pair.run(kMilli);
  const GateAxis::Now a = pair.joined.axis.look();
  const GateAxis::Now b = pair.single.axis.look();
  EXPECT_NEAR(a.truth.current_a.a, b.truth.current_a.a, 5e-4);
  EXPECT_NEAR(a.state.drive.bus_v, b.state.drive.bus_v, 5e-4);
}

// Catches: restored bytes of a timer that never changes its leg again, or that holds it where its setting
// does not.
TEST(GateParts, ATimerThatWouldStayWrongIsRefused) {
  using Words = std::array<std::int64_t, sizeof(LegTimer) / 8>;
  LegTimer timer;
  timer.set(pwm(0.4), 0);
  const Picoseconds now = kMicro;
  ASSERT_TRUE(timer.is_possible(now));
  ASSERT_TRUE(timer.is_possible(timer.next())) << "it changes at that instant";
  for (const Picoseconds next : {LegTimer::kNever, timer.next() + 1, now - 1}) {
    Words words = std::bit_cast<Words>(timer);
    ASSERT_EQ(words.back(), timer.next());
    words.back() = next;
    EXPECT_FALSE(std::bit_cast<LegTimer>(words).is_possible(now)) << next;
  }
  LegTimer low;
  low.set({.mode = LegMode::kLow}, 0);
  Words words = std::bit_cast<Words>(low);
  LegTimer high;
  high.set({.mode = LegMode::kHigh}, 0);
  words[0] = std::bit_cast<Words>(high)[0];  // the setting alone
  EXPECT_FALSE(std::bit_cast<LegTimer>(words).is_possible(now));
}

}  // namespace
}  // namespace drivebench::gate_parts_test
