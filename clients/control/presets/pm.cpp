#include <array>
#include <memory>
#include <numbers>
#include <vector>

#include "clients/control/moves/speed_steps.hpp"
#include "clients/control/presets/presets_families.hpp"
#include "clients/control/synchronous/pm_current_controller.hpp"
#include "clients/control/synchronous/pm_references.hpp"
#include "clients/control/synchronous/pm_speed_controller.hpp"
#include "clients/control/synchronous/pm_voltage_controller.hpp"
#include "plant/math/length.hpp"

namespace drivebench::control::pm_presets {
namespace {

/// The stepping motor of 9.1.4 with 50 pole pairs, 2000 counts, amplifiers of ±40 V and ±6 A.
constexpr PmMachineModel kStepper = {.pole_pairs = 50.0,
                                     .resistance_ohm = 0.55,
                                     .inductance_h = 1.5e-3,
                                     .torque_constant_nm_per_a = 0.19,
                                     .friction_nms = 8e-4,
                                     .inertia_kgm2 = 4.5e-5};
/// The servo motor of 9.2.3. K_m is 0.162, from which the printed results come, not the 0.243 listed there.
constexpr PmMachineModel kBm500 = {.pole_pairs = 4.0,
                                   .resistance_ohm = 0.25,
                                   .inductance_h = 1.4e-3,
                                   .torque_constant_nm_per_a = 0.162,
                                   .friction_nms = 0.0,
                                   .inertia_kgm2 = 1.39e-4,
                                   .star = true};

/// k23 and k24 of the move are those with which the other three give the printed poles.
constexpr PmFeedbackGains kMovePrinted = {.direct_per_s = 1.06e4,
                                          .quadrature_per_s = 1.78e4,
                                          .speed_a_per_rad = 340.0,
                                          .angle_a_per_rad_s = 3.8e6,
                                          .integral_a_per_rads2 = 1.07e7};
constexpr PmFeedbackGains kRunPrinted = {.direct_per_s = 2.587e4,
                                         .quadrature_per_s = 2.446e4,
                                         .speed_a_per_rad = 603.1,
                                         .angle_a_per_rad_s = 2.935e6,
                                         .integral_a_per_rads2 = 1.004e7};
/// At 10 kHz the printed gains put a pole of the sampled current loop at −1.6.
constexpr PmFeedbackGains kRunReduced = {.direct_per_s = 4000.0,
                                         .quadrature_per_s = 5121.0,
                                         .speed_a_per_rad = 508.1,
                                         .angle_a_per_rad_s = 2.993e5,
                                         .integral_a_per_rads2 = 1.48e6};

constexpr PmVoltageParameters kMoveController = {
    .machine = kStepper,
    .sample_rate_hz = 10e3,
    .counts_per_revolution = 2000.0,
    .voltage_limit_v = 40.0,
    .feedback = kMovePrinted,
    .speed_observer = {.angle_per_s = 5272.0, .speed_per_s2 = 7.0e6}};
constexpr PmVoltageParameters kRunController =
    with(kMoveController, &PmVoltageParameters::feedback, kRunReduced,
         &PmVoltageParameters::angle_lead_samples, 0.5);

/// 900 counts in 30 ms.
constexpr TrajectoryParameters kMove = {
    .distance_rad = 0.9 * std::numbers::pi, .ramp_up_s = 0.010, .cruise_s = 0.010, .ramp_down_s = 0.010};
/// 25π rad with t2 = 0.25 s; the book leaves t1 open, and below 0.125 s it takes more than 40 V.
constexpr TrajectoryParameters kRun = {
    .distance_rad = 25.0 * std::numbers::pi, .ramp_up_s = 0.2, .cruise_s = 0.05, .ramp_down_s = 0.2};

constexpr MoveAllowance kStepperLimits = {.voltage_v = 40.0, .current_a = 6.0};
/// The references of the move pass through 40.4 V for a moment; there the amplifier clips a phase.
constexpr MoveAllowance kMoveAllowance = {.voltage_v = 42.0, .current_a = 6.0};

/// Voltage and current of the references as vectors.
std::array<Demand, 2> reference_demands(const PmVoltageParameters& p, const MoveAllowance& allowed,
                                        const Reference& r) {
  const PmReferences ref = pm_references(p.machine, r);
  return {Demand{"stator voltage", length(ref.voltage_v.d, ref.voltage_v.q), allowed.voltage_v, "V"},
          Demand{"stator current", length(ref.current_a.d, ref.current_a.q), allowed.current_a, "A"}};
}

/// The same of steady currents.
std::array<Demand, 2> steady_demands(const PmCurrentParameters& p, const MoveAllowance& allowed,
                                     const Reference& r) {
  Dq i = pm_references(p.machine, r).current_a;
  i.d = direct_current_within_voltage_a(p.machine, p.voltage_limit_v, r.speed_rad_s, i.q);
  return {Demand{"stator voltage", steady_voltage_v(p.machine, r.speed_rad_s, i), allowed.voltage_v, "V"},
          Demand{"stator current", length(i.d, i.q), allowed.current_a, "A"}};
}

constexpr RunTiming kTiming = {.sample_rate_hz = 10e3, .prepare_s = 0.002, .hold_s = 0.020};

constexpr double kBm500Voltage = 124.75;  // √(3/2)·(2/π)·160 V

constexpr PmCurrentParameters kBm500Servo = {
    .machine = kBm500,
    .sample_rate_hz = 10e3,
    .counts_per_revolution = 8192.0,
    .voltage_limit_v = 110.0,
    .current_limit_a = 22.05,
    .position = ServoGains::placed(150.0, 150.0, 150.0),
    .speed_observer = SpeedObserverGains::placed(1500.0, 1500.0, 0.0)};
/// Ten turns in 0.15 s, up to 6000 rpm.
constexpr TrajectoryParameters kBm500Move = {
    .distance_rad = 20.0 * std::numbers::pi, .ramp_up_s = 0.05, .cruise_s = 0.05, .ramp_down_s = 0.05};
constexpr MoveAllowance kBm500Limits = {.voltage_v = kBm500Voltage, .current_a = 22.05};
constexpr RunTiming kBm500Timing = {.sample_rate_hz = 10e3, .prepare_s = 0.005, .hold_s = 0.030};

constexpr PmSpeedParameters kRunUp22 = {
    .machine = kBm500,
    .sample_rate_hz = 20e3,
    .counts_per_revolution = 8192.0,
    .voltage_limit_v = kBm500Voltage,
    .current_limit_a = 22.05,
    .speed_gain_per_s = 2000.0,
    .max_speed_rad_s = 1050.0,
    .current = {.proportional_v_per_a = 10.0, .integral_v_per_as = 2000.0},
    .speed_observer = SpeedObserverGains::placed(3000.0, 3000.0, 0.0)};
/// Towards 10 000 rpm, which the bearings stand, and back as soon as 1000 rad/s are there.
constexpr SpeedStepsParameters kUpAndDown22 = {
    .first_rad_s = 1047.2, .first_s = 0.0440, .second_rad_s = 0.0, .second_s = 0.045};
constexpr SpeedStepsParameters kUpAndDown67 = {
    .first_rad_s = 1047.2, .first_s = 0.0235, .second_rad_s = 0.0, .second_s = 0.025};
constexpr RunTiming kRunUpTiming = {.sample_rate_hz = 20e3, .prepare_s = 0.002, .hold_s = 0.005};

Run voltage_run(const PmVoltageParameters& p, const TrajectoryParameters& path, const MoveAllowance& allowed,
                const RunTiming& timing) {
  return cubic_run<PmVoltageController>(p, path, allowed, timing, reference_demands);
}

Run current_run(const PmCurrentParameters& p, const TrajectoryParameters& path, const MoveAllowance& allowed,
                const RunTiming& timing) {
  return cubic_run<PmCurrentController>(p, path, allowed, timing, steady_demands);
}

Run speed_run(const PmSpeedParameters& p, const SpeedStepsParameters& steps, const RunTiming& timing) {
  return run_at(p.sample_rate_hz, std::make_unique<PmSpeedController>(p), std::make_shared<SpeedSteps>(steps),
                timing);
}

template <class P>
Requirements needs_of(const P& p, double voltage_limit_v, Quantity quantity = Quantity::kVoltage) {
  return {.machine_kind = "pm_synchronous",
          .counts_per_revolution = p.counts_per_revolution,
          .pole_pairs = p.machine.pole_pairs,
          .voltage_limit_v = voltage_limit_v,
          .quantity = quantity};
}

/// √(2/3) of the two-phase limit: that of a phase.
constexpr double kBm500PhaseVoltage = 101.8;

Preset stepper(const PresetText& text, const PmVoltageParameters& p, const TrajectoryParameters& path,
               const MoveAllowance& allowed) {
  return preset_of(text, needs_of(p, p.voltage_limit_v), voltage_run, p, path, allowed, kTiming);
}

Preset run_up(const PresetText& text, const PmSpeedParameters& p, const SpeedStepsParameters& steps) {
  return preset_of(text, needs_of(p, kBm500PhaseVoltage), speed_run, p, steps, kRunUpTiming);
}

}  // namespace

std::vector<Preset> all() {
  using P = PmVoltageParameters;
  return {
      stepper(
          {"book/9.1.4", "Chiasson 2005, 9.1.4: 1.8 mm in 30 ms, 900 counts, state feedback to the voltages",
           "peak error at most 3 counts, the encoder within 1 count of 900; one tick of delay loses control",
           "pm-stepper"},
          kMoveController, kMove, kMoveAllowance),
      stepper(
          {"book/9.1.4-swapped", "as book/9.1.4 with k11 and k22 exchanged, which gives the printed poles",
           "peak error at most 3 counts, the encoder within 1 count of 900", "pm-stepper"},
          with(kMoveController, &P::feedback,
               with(kMovePrinted, &PmFeedbackGains::direct_per_s, kMovePrinted.quadrature_per_s,
                    &PmFeedbackGains::quadrature_per_s, kMovePrinted.direct_per_s)),
          kMove, kMoveAllowance),
      stepper({"book/9.1.4-backward-difference",
               "as book/9.1.4, speed by backward difference, with which the book's motor did not track",
               "tracks all the same, with three times the clipped samples", "pm-stepper"},
              with(kMoveController, &P::speed_source, SpeedSource::kBackwardDifference), kMove,
              kMoveAllowance),
      stepper({"book/9.7-3000rpm",
               "Chiasson 2005, problem 9.7: 3000 rpm at 10 kHz, gains reduced to what 10 kHz can sample",
               "peak error at most 10 counts, final at most 1", "pm-stepper-centred"},
              kRunController, kRun, kStepperLimits),
      stepper({"book/9.7-3000rpm-floor", "as book/9.7-3000rpm with an encoder that rounds down: a mistake",
               "fails: more than 1000 counts", "pm-stepper"},
              kRunController, kRun, kStepperLimits),
      stepper(
          {"book/9.7-3000rpm-no-lead", "as book/9.7-3000rpm without turning the voltages ahead: a mistake",
           "fails: more than 1000 counts", "pm-stepper-centred"},
          with(kRunController, &P::angle_lead_samples, 0.0), kRun, kStepperLimits),
      stepper({"book/9.7-3000rpm-20khz", "as book/9.7-3000rpm at 20 kHz with the gains of the book",
               "peak error at most 2 counts, final at most 1", "pm-stepper-20khz"},
              with(kRunController, &P::feedback, kRunPrinted, &P::sample_rate_hz, 20e3), kRun,
              kStepperLimits),
      preset_of(
          {"pm/current-servo", "Chiasson 2005, (9.49)-(9.52) on the motor of 9.2.3; move and gains are ours",
           "peak error at most 30 counts of 8192, final at most 1", "bm500-current"},
          needs_of(kBm500Servo, kBm500PhaseVoltage, Quantity::kCurrent), current_run, kBm500Servo, kBm500Move,
          kBm500Limits, kBm500Timing),
      run_up({"book/9.8-22a",
              "Chiasson 2005, problem 9.8 and figures 9.25-9.28: run-up to 10 000 rpm, 18 A of a phase",
              "1000 rad/s after 44.0 ms, at rest again after 84.3 ms", "bm500-run-up"},
             kRunUp22, kUpAndDown22),
      run_up({"book/9.8-67a", "as book/9.8-22a with 55 A of a phase",
              "1000 rad/s after 23.5 ms, at rest again after 44.7 ms", "bm500-run-up"},
             with(kRunUp22, &PmSpeedParameters::current_limit_a, 67.36), kUpAndDown67),
  };
}

}  // namespace drivebench::control::pm_presets
