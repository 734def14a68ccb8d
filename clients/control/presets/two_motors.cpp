#include <memory>
#include <numbers>
#include <vector>

#include "clients/control/moves/speed_ramp.hpp"
#include "clients/control/presets/presets_families.hpp"
#include "clients/control/synchronous/two_motor_controller.hpp"

namespace drivebench::control::two_motor_presets {
namespace {

// The book has the exercise and no numbers: the stepper of section 9.1.4 twice, the second with a flywheel.

constexpr PmMachineModel kStepper = {.pole_pairs = 50.0,
                                     .resistance_ohm = 0.55,
                                     .inductance_h = 1.5e-3,
                                     .torque_constant_nm_per_a = 0.19,
                                     .friction_nms = 8e-4,
                                     .inertia_kgm2 = 4.5e-5};
constexpr PmMachineModel kWithFlywheel = with(kStepper, &PmMachineModel::inertia_kgm2, 9e-5);

/// One full step more is a quarter of an electrical turn.
constexpr double kStep_rad = 0.5 * std::numbers::pi / 50.0;

constexpr TwoMotorParameters kTwoMotors = {
    .first = kStepper,
    .second = kWithFlywheel,
    .sample_rate_hz = 10e3,
    .counts_per_revolution = 50000.0,
    .voltage_limit_v = 3.0,
    .current_limit_a = 1.5,
    .position = ServoGains::placed(100.0, 100.0, 100.0),
    .speed_observer = {.angle_per_s = 3000.0, .speed_per_s2 = 2.25e6},
    .current_v_per_a = 3.0,
    .near_determinant = 0.3,
    .damping = 0.1,
    .rest_s = 0.15,
    // From a quarter of an electrical turn ahead through 0 to a quarter behind, in 0.1 s at 4 rad/s.
    .fall_back = {.distance_rad = 2.0 * kStep_rad, .from_rad = 1.8, .over_rad = 0.4}};

constexpr SpeedRampParameters kMove = {.speed_rad_s = 4.0, .ramp_s = 0.3, .cruise_s = 0.7};
constexpr RunTiming kTiming = {.sample_rate_hz = 10e3, .prepare_s = 0.2, .hold_s = 0.0};

Run run(const TwoMotorParameters& p, const SpeedRampParameters& move, const RunTiming& timing) {
  return run_at(p.sample_rate_hz, std::make_unique<TwoMotorController>(p), std::make_shared<SpeedRamp>(move),
                timing);
}

}  // namespace

std::vector<Preset> all() {
  return {
      preset_of({"exercise/9.9",
                 "Chiasson 2005, problem 9.9: two PM motors on one amplifier; machines, gains and move ours",
                 "both within 0.2 degrees where the determinant is not near 0; through 0 the second within 3",
                 "two-steppers"},
                {.machine_kind = "pm_synchronous",
                 .counts_per_revolution = kTwoMotors.counts_per_revolution,
                 .pole_pairs = kStepper.pole_pairs,
                 .voltage_limit_v = kTwoMotors.voltage_limit_v,
                 .drives_second = true},
                run, kTwoMotors, kMove, kTiming)};
}

}  // namespace drivebench::control::two_motor_presets
