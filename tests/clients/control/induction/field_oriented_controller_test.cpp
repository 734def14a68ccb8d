#include "clients/control/induction/field_oriented_controller.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "clients/control/math/wrapped.hpp"
#include "clients/control/presets/induction_servo.hpp"

namespace drivebench::control::field_oriented_controller_test {
namespace {

const ControllerParameters& book() {
  return kServoController;
}

ControlOutput updated(FieldOrientedController& controller, const Measurement& m, const Reference& r,
                      std::int64_t periods = 1) {
  controller.update(m, r, periods);
  return controller.output();
}

/// A controller whose flux has been built up with the current it asks for, at standstill.
FieldOrientedController magnetised(const ControllerParameters& p, double* peak_flux_wb = nullptr) {
  FieldOrientedController controller(p);
  double i_d_a = 0.0;
  for (int k = 0; k < 800; ++k) {
    const ControlOutput out = updated(controller, {.encoder_count = 0, .i_a_a = i_d_a, .i_b_a = 0.0}, {});
    i_d_a = out.i_d_reference_a;
    if (peak_flux_wb != nullptr) *peak_flux_wb = std::max(*peak_flux_wb, out.flux_estimate_wb);
  }
  return controller;
}

// Catches: a wrong factor before the reference current (the book prints α_ref/ψ_d0, a factor μ = 22792 too
// much), a wrong count-to-angle scale, and the sign of the position error.
TEST(FieldOrientedController, QuadratureReferenceIsTheWantedAccelerationOverMuPsi) {
  const double per_ampere = 22792.2 * 0.0117 * 5.5 / std::numbers::sqrt2;
  FieldOrientedController feedforward(book());
  const ControlOutput a =
      updated(feedforward, {.encoder_count = 7, .i_a_a = 0.0, .i_b_a = 0.0}, {.acceleration_rad_s2 = 3653.0});
  EXPECT_NEAR(a.i_q_reference_a, 3653.0 / per_ampere, 1e-4);

  FieldOrientedController feedback(book());
  updated(feedback, {.encoder_count = 7, .i_a_a = 0.0, .i_b_a = 0.0}, {});
  const ControlOutput b = updated(feedback, {.encoder_count = 6, .i_a_a = 0.0, .i_b_a = 0.0}, {});
  EXPECT_NEAR(b.position_error_counts, 1.0, 1e-12);
  EXPECT_NEAR(b.i_q_reference_a, 7.04e5 * 2.0 * std::numbers::pi / 2000.0 / per_ampere,
              1e-4);  // 2.1 A a count
}

// Catches: the printed "− f·ω": with the reference at the estimated speed, what is left is +f·ω of torque.
TEST(FieldOrientedController, FrictionIsFedForwardWithAPlusSign) {
  ControllerParameters p = book();
  p.machine.friction_nms = 0.01;
  p.speed_source = SpeedSource::kBackwardDifference;
  FieldOrientedController controller(p);
  const double rad_per_count = 2.0 * std::numbers::pi / 2000.0;
  updated(controller, {.encoder_count = 0, .i_a_a = 0.0, .i_b_a = 0.0}, {});
  const ControlOutput out =
      updated(controller, {.encoder_count = 3, .i_a_a = 0.0, .i_b_a = 0.0},
              {.angle_rad = 3.0 * rad_per_count, .speed_rad_s = 24000.0 * rad_per_count});
  const double torque_nm =
      out.i_q_reference_a * p.machine.inertia_kgm2 * p.machine.acceleration_per_wb_a() * p.rated_flux_wb();
  EXPECT_NEAR(torque_nm, 0.01 * 24000.0 * rad_per_count, 1e-9);
}

// Catches: an i_d reference above 0.98 of the amplifier's limit and its integrator winding up there: the flux
// would overshoot by 3.6 percent. The 1.5 percent that are left gather between the end of the clip and the
// rated flux.
TEST(FieldOrientedController, FluxBuildsUpAtTheClipWithoutOvershoot) {
  FieldOrientedController cold(book());
  const ControlOutput first = updated(cold, {.encoder_count = 0, .i_a_a = 0.0, .i_b_a = 0.0}, {});
  EXPECT_NEAR(first.i_d_reference_a, 5.88, 1e-12);
  EXPECT_TRUE(first.references_clipped);
  double peak_flux_wb = 0.0;
  magnetised(book(), &peak_flux_wb);
  EXPECT_NEAR(peak_flux_wb, book().rated_flux_wb(), 0.02 * book().rated_flux_wb());
}

// Catches: position wind-up: ten samples at the 8 A clip would leave 1.3 A behind.
TEST(FieldOrientedController, PositionIntegratorStandsStillWhileItsReferenceIsClipped) {
  FieldOrientedController controller = magnetised(book());
  const Measurement at_rest = {.encoder_count = 0, .i_a_a = book().rated_direct_current_a, .i_b_a = 0.0};
  for (int k = 0; k < 10; ++k) {
    const ControlOutput out = updated(controller, at_rest, {.angle_rad = 1.0});
    EXPECT_EQ(out.i_q_reference_a, 8.0);
    EXPECT_TRUE(out.references_clipped);
  }
  EXPECT_NEAR(updated(controller, at_rest, {}).i_q_reference_a, 0.0, 1e-9);
}

// Catches: outer integrators that run on while the amplifier is at its limit, where their error cannot be
// worked off.
TEST(FieldOrientedController, PositionIntegratorStandsStillWhileTheVoltageIsAtItsLimit) {
  ControllerParameters p = book();
  p.speed_source = SpeedSource::kBackwardDifference;  // 0 here, whatever the currents say
  FieldOrientedController controller = magnetised(p);
  const Reference half_a_count_ahead = {.angle_rad = std::numbers::pi / 2000.0};
  const auto reference_with = [&](double i_b_a, bool saturated) {
    const ControlOutput out =
        updated(controller, {.encoder_count = 0, .i_a_a = p.rated_direct_current_a, .i_b_a = i_b_a},
                half_a_count_ahead);
    EXPECT_EQ(out.voltage_saturated, saturated);
    EXPECT_FALSE(out.references_clipped);
    return out.i_q_reference_a;
  };
  const double before_a = reference_with(-20.0, true);
  EXPECT_EQ(reference_with(-20.0, true), before_a);
  EXPECT_EQ(reference_with(0.0, false), before_a);
  EXPECT_GT(reference_with(0.0, false), before_a);  // and it runs again
}

// Catches: a controller that works only from count 0: everything must depend on the distance from the start
// count.
TEST(FieldOrientedController, StartCountDoesNotMatter) {
  FieldOrientedController here(book());
  FieldOrientedController there(book());
  constexpr std::int64_t kFar = -9'007'199'254'740'993;  // not representable as a double
  for (int k = 0; k < 100; ++k) {
    const Reference r = {.angle_rad = 0.001 * k, .speed_rad_s = 8.0};
    const ControlOutput a = updated(here, {.encoder_count = k / 3, .i_a_a = 1.0, .i_b_a = 0.1}, r);
    const ControlOutput b = updated(there, {.encoder_count = kFar + k / 3, .i_a_a = 1.0, .i_b_a = 0.1}, r);
    EXPECT_EQ(a.u_a_v, b.u_a_v);
    EXPECT_EQ(a.u_b_v, b.u_b_v);
  }
}

// Catches: observers that stand still over lost samples: at 70 rad/s each lost period turns the flux by 1.5
// degrees.
TEST(FieldOrientedController, FluxAngleIsCarriedOverLostSamples) {
  const auto angle_after = [](std::int64_t stride) {
    FieldOrientedController controller(book());
    const double counts_per_period = 70.0 / (2.0 * std::numbers::pi) * 2000.0 / 8000.0;
    ControlOutput out;
    for (std::int64_t k = 0; k <= 400; k += k < 360 ? 1 : stride) {
      const auto count = static_cast<std::int64_t>(std::floor(counts_per_period * static_cast<double>(k)));
      out = updated(controller, {.encoder_count = count, .i_a_a = 0.0, .i_b_a = 0.0}, {},
                    k <= 360 ? 1 : stride);
    }
    return out.flux_angle_estimate_rad;
  };
  // Five periods of 1.5 degrees each per gap, eight gaps: without the carry the angle would be 48 degrees
  // behind.
  EXPECT_NEAR(wrapped(angle_after(5) - angle_after(1)), 0.0, 0.02);
}

}  // namespace
}  // namespace drivebench::control::field_oriented_controller_test
