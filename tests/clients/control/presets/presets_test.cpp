#include "clients/control/presets/presets.hpp"

#include <gtest/gtest.h>

#include <set>

#include "clients/control/presets/induction_servo.hpp"
#include "protocols/nearest_name.hpp"

namespace drivebench::control::presets_test {
namespace {

// Catches: a preset whose numbers break its own rules, two of the same name, and one that says nothing of
// itself.
TEST(Presets, AreAllUsableAndNamedOnce) {
  std::set<std::string_view> names;
  for (const Preset& p : presets()) {
    EXPECT_TRUE(names.insert(p.name).second) << p.name;
    EXPECT_EQ(find_preset(p.name), &p);
    EXPECT_FALSE(p.source.empty()) << p.name;
    EXPECT_FALSE(p.expectation.empty()) << p.name;
    EXPECT_FALSE(p.bench.empty()) << p.name;
    EXPECT_FALSE(p.needs.machine_kind.empty()) << p.name;
    const control::Run run = p.make({});
    EXPECT_EQ(run.controller().quantity(), p.needs.quantity) << p.name;
    EXPECT_GT(run.planned_samples(), 0) << p.name;
    EXPECT_EQ(run.controller().telemetry().size(), run.controller().telemetry_names().size()) << p.name;
  }
}

// Catches: a mistyped gain: the closed-loop polynomials of the book's gains must have the poles of exercise
// 14 (case 2), mechanical −534.24 ± j645.73 and −1.52, flux −5479.75 and −13.68, to 0.2 %.
TEST(Presets, BookGainsHaveTheClosedLoopPolesOfExercise14) {
  const ControllerParameters& c = kServoController;
  const double pair_sum = 2.0 * 534.24;
  const double pair_product = 534.24 * 534.24 + 645.73 * 645.73;
  EXPECT_NEAR(c.position.derivative_per_s, pair_sum + 1.52, 0.002 * 1070.0);
  EXPECT_NEAR(c.position.proportional_per_s2, pair_product + 1.52 * pair_sum, 0.002 * 7.04e5);
  EXPECT_NEAR(c.position.integral_per_s3, 1.52 * pair_product,
              0.003 * 1.07e6);  // 1.52 itself is printed to 0.3 %
  const double eta_m = c.machine.flux_decay_per_s() * c.machine.mutual_inductance_h;
  EXPECT_NEAR(c.machine.flux_decay_per_s() + eta_m * c.flux.proportional_a_per_wb, 5479.75 + 13.68, 1.0);
  EXPECT_NEAR(eta_m * c.flux.integral_a_per_wbs, 5479.75 * 13.68, 0.002 * 74963.0);
  EXPECT_NEAR(c.rated_flux_wb(), 0.0455, 5e-5);
}

// Catches: a suggestion that is not the obvious one, and a lookup that takes it silently.
TEST(Presets, MisspeltNameFindsNothingButSuggestsTheNearest) {
  EXPECT_EQ(find_preset("book/8.2.2-4kHz"), nullptr);
  const auto nearest = [](std::string_view name) { return nearest_name(name, presets(), &Preset::name); };
  EXPECT_EQ(nearest("book/8.2.2-4kHz"), "book/8.2.2-4khz");
  EXPECT_EQ(nearest("book/822"), "book/8.2.2");
  EXPECT_EQ(nearest("backward-difference"), "book/8.2.2-backward-difference");
}

// Catches: a check that stops at the first problem.
TEST(ControllerParameters, NamesEveryProblemAtOnce) {
  ControllerParameters broken = kServoController;
  broken.machine.inertia_kgm2 = 0.0;
  broken.counts_per_revolution = -1;
  broken.current.integral_v_per_as = -1.0;
  EXPECT_EQ(broken.problems().size(), 3U);
}

}  // namespace
}  // namespace drivebench::control::presets_test
