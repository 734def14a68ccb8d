#include <memory>
#include <numbers>
#include <vector>

#include "clients/control/induction/induction_demands.hpp"
#include "clients/control/induction/input_output_controller.hpp"
#include "clients/control/induction/torque_optimal_move.hpp"
#include "clients/control/presets/induction_servo.hpp"
#include "clients/control/presets/presets_families.hpp"

// Input-output linearisation against field-oriented control where the flux has to change: the move to 8000
// rpm and exercise 15.
namespace drivebench::control::induction_input_output_presets {
namespace {

using Drive = InductionDriveParameters;

/// The servo motor without friction at 4 kHz, as in 8.2.5. The 8 A for i_q,ref are ours; the moves that are
/// followed stay below them.
constexpr Drive kDrive =
    with(kServoDrive8Khz, &Drive::sample_rate_hz, 4000.0, &Drive::motor,
         with(kServoDrive8Khz.motor, &InductionMotorModel::machine,
              with(kServoDrive8Khz.motor.machine, &InductionMachineModel::friction_nms, 0.0)));
constexpr Drive kDrive60V = with(kDrive, &Drive::voltage_limit_v, 60.0);

constexpr InputOutputParameters kTextGains = {
    .current = {.proportional_v_per_a = 15.0, .integral_v_per_as = 9000.0},
    .position = {.integral_per_s3 = 3.0e5, .proportional_per_s2 = 5.5e4, .derivative_per_s = 125.0},
    .flux = {.proportional_a_per_wb = 1e4, .integral_a_per_wbs = 4.2e5}};

/// The text's flux loop has a pole at −32830 1/s, beyond what 4 kHz can sample; this one has its at −545 and
/// −60 1/s.
constexpr FluxGains kSoftFlux = {.proportional_a_per_wb = 100.0, .integral_a_per_wbs = 1e4};

using Law = InputOutputParameters;
constexpr Law kSoftGains = with(kTextGains, &Law::flux, kSoftFlux);
constexpr Law kFieldOriented = with(kSoftGains, &Law::divisor, TorqueDivisor::kFluxReference);
/// The gains of 8.2.2.
constexpr Law kFieldOriented822 = {.current = kServoController.current,
                                   .position = kServoController.position,
                                   .flux = kServoController.flux,
                                   .divisor = TorqueDivisor::kFluxReference};

using Flux = FluxReferenceParameters;
constexpr Flux kConstantFlux = {.rated_flux_wb = kServoController.rated_flux_wb(), .base_speed_rad_s = 313.0};
constexpr Flux kOptimumFlux = with(kConstantFlux, &Flux::policy, FluxPolicy::kOptimumTorque);
constexpr Flux kWeakenedFlux = with(kConstantFlux, &Flux::policy, FluxPolicy::kFieldWeakening);
/// Exercise 15: weakening from 250 rad/s on, no feed-forward of i_d.
constexpr Flux kExerciseFlux = with(kWeakenedFlux, &Flux::base_speed_rad_s, 250.0, &Flux::feed_forward, 0.0);

constexpr TorqueMoveParameters kMove = {.top_speed_rad_s = 8000.0 * 2.0 * std::numbers::pi / 60.0,
                                        .run_up_s = 0.38,
                                        .run_down_s = 0.265,
                                        .torque_ramp_s = 0.030};
/// ω_max = 838 rad/s: θ_f = ω_max·t2 with t1 = 1.5 s, t2 = 1.6 s.
constexpr TrajectoryParameters kFastMove = {
    .distance_rad = 838.0 * 1.6, .ramp_up_s = 1.5, .cruise_s = 0.1, .ramp_down_s = 1.5};

constexpr RunTiming kTiming = {.sample_rate_hz = 4000.0, .prepare_s = 0.05, .hold_s = 0.05};

constexpr MoveAllowance kWithin80V6A = {.voltage_v = 80.0, .current_a = 6.0};
constexpr MoveAllowance kWithin60V6A = {.voltage_v = 60.0, .current_a = 6.0};
/// For runs that show what happens when a move is made that should have been refused.
constexpr MoveAllowance kUnchecked = {.voltage_v = 1e6, .current_a = 1e6};

struct Plan {
  std::shared_ptr<const Trajectory> move;
  Flux flux;
  std::shared_ptr<const OptimumTorqueTable> optimum{};
};

Plan planned(const Drive& drive, Flux flux, const TorqueMoveParameters& move) {
  const VectorLimits limits = {.voltage_v = drive.voltage_limit_v, .current_a = drive.current_limit_a};
  const auto optimum = std::make_shared<const OptimumTorqueTable>(SteadyInductionModel::of(drive.motor),
                                                                  limits, move.top_speed_rad_s);
  const auto trajectory = std::make_shared<const TorqueOptimalMove>(move, *optimum, drive.motor.machine);
  flux.motoring_share = trajectory->motoring_share();
  flux.generating_share = trajectory->generating_share();
  return {trajectory, flux, optimum};
}

Plan planned(const Drive&, const Flux& flux, const TrajectoryParameters& move) {
  return {std::make_shared<const CubicMove>(move), flux};
}

template <class Move>
Run run(const Drive& drive, const Law& law, const Flux& flux, const Move& move, const MoveAllowance& allowed,
        const RunTiming& timing) {
  const Plan plan = planned(drive, flux, move);
  refuse(first_exceeded(*plan.move,
                        FluxReference(plan.flux, drive.motor.machine, drive.period_s(), plan.optimum),
                        drive.period_s(), InductionDemands(drive.motor, allowed)));
  return run_at(drive.sample_rate_hz,
                std::make_unique<InputOutputController>(drive, law, plan.flux, plan.optimum), plan.move,
                timing);
}

template <class Move>
Preset preset(const PresetText& text, const Drive& drive, const Law& law, const Flux& flux, const Move& move,
              const MoveAllowance& allowed) {
  return preset_of(text, induction_needs(drive, drive.motor.machine.pole_pairs), run<Move>, drive, law, flux,
                   move, allowed, kTiming);
}

}  // namespace

std::vector<Preset> all() {
  return {
      preset({"book/8.2.5",
              "Chiasson 2005, 8.2.5: input-output linearisation, 0 to 8000 rpm in 0.38 s and back in 0.265 "
              "s, gains of the text; no friction",
              "peak error at most 50 counts (text 34), final 0 to 3; the flux loop limit-cycles at 4 kHz",
              "servo-8000rpm"},
             kDrive, kTextGains, kOptimumFlux, kMove, kWithin80V6A),
      preset({"book/8.2.5-soft-flux", "as book/8.2.5 with flux gains 100 and 1e4, which 4 kHz can sample",
              "peak error at most 8 counts (3.7), final at most 1 (2 of the encoder), currents below 6 A",
              "servo-8000rpm"},
             kDrive, kSoftGains, kOptimumFlux, kMove, kWithin80V6A),
      preset({"book/8.2.5-constant-flux",
              "the move of book/8.2.5 under field-oriented control with constant flux: the text's "
              "unsuccessful trial",
              "fails: final error above 1000 counts, more than half of the samples at the voltage limit",
              "servo-8000rpm"},
             kDrive, kFieldOriented, kConstantFlux, kMove, kUnchecked),
      preset({"book/8.2.5-field-weakening",
              "the move of book/8.2.5 under field-oriented control with standard field weakening (8.24) from "
              "313 rad/s on",
              "follows within 4 counts, but only with 7.8 A: braking takes more than the amplifier's 6 A",
              "servo-8000rpm"},
             kDrive, kFieldOriented, kWeakenedFlux, kMove, kUnchecked),
      preset(
          {"book/8.2.5-friction", "book/8.2.5 on the motor with its listed friction, which forbids the move",
           "fails: peak error above 100 counts", "servo-4khz"},
          kDrive, kTextGains, kOptimumFlux, kMove, kWithin80V6A),
      preset({"exercise/8.15a-field-oriented",
              "Chiasson 2005, exercise 15(a) of chapter 8: half a turn, 75 rad/s, gains of 8.2.2, 60 V, no "
              "friction",
              "peak error about 2 counts", "servo-frictionless"},
             with(kDrive60V, &Drive::sample_rate_hz, 8000.0), kFieldOriented822, kExerciseFlux,
             kMoveOfExercise15, kWithin60V6A),
      preset(
          {"exercise/8.15a", "as exercise/8.15a-field-oriented by input-output linearisation, gains of 8.2.5",
           "peak error about 8 counts", "servo-8000rpm"},
          kDrive60V, kTextGains, kExerciseFlux, kMoveOfExercise15, kWithin60V6A),
      preset({"exercise/8.15b",
              "Chiasson 2005, exercise 15(b) of chapter 8: 838 rad/s in 1.5 s, 60 V, field weakening from "
              "250 rad/s on, no friction; soft flux gains",
              "peak error about 1 count, peak phase 58 V, 4 A", "servo-8000rpm"},
             kDrive60V, kSoftGains, kExerciseFlux, kFastMove, kWithin60V6A),
      preset({"exercise/8.15b-text-gains", "as exercise/8.15b with the flux gains of 8.2.5",
              "peak error at most 30 counts (6.3 in the reference table): the flux loop limit-cycles",
              "servo-8000rpm"},
             kDrive60V, kTextGains, kExerciseFlux, kFastMove, kWithin60V6A),
  };
}

}  // namespace drivebench::control::induction_input_output_presets
