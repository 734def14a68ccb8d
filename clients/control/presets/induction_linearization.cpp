#include <memory>
#include <numbers>
#include <vector>

#include "clients/control/induction/dynamic_linearization.hpp"
#include "clients/control/induction/induction_demands.hpp"
#include "clients/control/induction/voltage_linearization_controller.hpp"
#include "clients/control/presets/induction_servo.hpp"
#include "clients/control/presets/presets_families.hpp"

// The linearisations of an induction machine that the book gives equations for but no experiment: with
// voltage command, and with an integrator before either current. Gains and moves are ours.
namespace drivebench::control::induction_linearization_presets {
namespace {

constexpr VoltageLinearizationParameters kVoltage =
    VoltageLinearizationParameters::placed(250.0, 300.0, 1.4e-4 / 1.1e-4);

constexpr DirectIntegratorParameters kDirect = {
    .current_pole_per_s = 2500.0,
    .position = {.integral_per_s3 = 3.0e5, .proportional_per_s2 = 5.5e4, .derivative_per_s = 400.0},
    .flux_proportional_per_s2 = 4e4,
    .flux_derivative_per_s = 400.0,
    .least_distance = 0.1};

constexpr QuadratureIntegratorParameters kQuadrature = {.current_pole_per_s = 2500.0,
                                                        .angle_pole_per_s = 200.0,
                                                        .slip_pole_per_s = 200.0,
                                                        .load_pole_per_s = 300.0,
                                                        .least_i_q_a = 0.3};

/// A slip of η makes both currents alike; 0.05 N·m are a third of the least torque on the way.
constexpr FlatInductionParameters kFlat = {.current_pole_per_s = 2500.0,
                                           .slip_rad_s = 3.9 / 0.014,
                                           .position = ServoGains::placed(200.0, 200.0, 200.0),
                                           .load_pole_per_s = 300.0,
                                           .least_torque_nm = 0.05};

using Flux = FluxReferenceParameters;
constexpr Flux kConstantFlux = {.rated_flux_wb = kServoController.rated_flux_wb(), .base_speed_rad_s = 300.0};
constexpr Flux kWeakenedFlux =
    with(kConstantFlux, &Flux::base_speed_rad_s, 60.0, &Flux::policy, FluxPolicy::kFieldWeakening);

/// Slow enough that the motor never stops lifting 0.25 N·m.
constexpr TrajectoryParameters kHoistMove = {
    .distance_rad = std::numbers::pi, .ramp_up_s = 0.050, .cruise_s = 0.020, .ramp_down_s = 0.050};
/// 73 rad/s: the flux is made to fall above 60 rad/s.
constexpr TrajectoryParameters kWeakeningMove = {
    .distance_rad = 7.0 * std::numbers::pi, .ramp_up_s = 0.2, .cruise_s = 0.1, .ramp_down_s = 0.2};

constexpr RunTiming kTiming = {.sample_rate_hz = 8000.0, .prepare_s = 0.05, .hold_s = 0.05};
/// The load needs time to settle in.
constexpr RunTiming kHoistTiming = {.sample_rate_hz = 8000.0, .prepare_s = 0.25, .hold_s = 0.1};
constexpr MoveAllowance kAmplifier = {.voltage_v = 80.0, .current_a = 6.0};

template <class ControllerType, class Law>
Run run(const InductionDriveParameters& drive, const Law& law, const Flux& flux,
        const TrajectoryParameters& move, const MoveAllowance& allowed, const RunTiming& timing) {
  const auto trajectory = std::make_shared<const CubicMove>(move);
  refuse(first_exceeded(*trajectory, FluxReference(flux, drive.motor.machine, drive.period_s()),
                        drive.period_s(), InductionDemands(drive.motor, allowed)));
  return run_at(drive.sample_rate_hz, std::make_unique<ControllerType>(drive, law, flux), trajectory, timing);
}

template <class ControllerType, class Law>
Preset preset(const PresetText& text, const Law& law, const Flux& flux, const TrajectoryParameters& move,
              const RunTiming& timing = kTiming) {
  constexpr InductionDriveParameters kDrive = kServoDrive8Khz;
  return preset_of(text, induction_needs(kDrive, kDrive.motor.machine.pole_pairs), run<ControllerType, Law>,
                   kDrive, law, flux, move, kAmplifier, timing);
}

Run flat_run(const InductionDriveParameters& drive, const FlatInductionParameters& law,
             const TrajectoryParameters& move, const RunTiming& timing) {
  return run_at(drive.sample_rate_hz, std::make_unique<FlatInductionController>(drive, law),
                std::make_shared<const JerkContinuousMove>(move), timing);
}

}  // namespace

std::vector<Preset> all() {
  return {
      preset<VoltageLinearizationController>({"book/8.2.5-voltage",
                                              "Chiasson 2005, (8.33): input-output linearisation with "
                                              "voltage command, on the move of book/8.2.2; gains "
                                              "ours",
                                              "peak error below 3 counts, without a current loop", "servo"},
                                             kVoltage, kConstantFlux, kServoMove),
      preset<DirectIntegratorController>(
          {"exercise/8.28",
           "Chiasson 2005, exercise 28 of chapter 8: dynamic linearisation, integrator on the d axis, 73 "
           "rad/s with "
           "the flux falling from 60 rad/s on; gains and move ours",
           "peak error below 3 counts, never singular once the flux is up", "servo"},
          kDirect, kWeakenedFlux, kWeakeningMove),
      preset<DirectIntegratorController>({"exercise/8.28-singular",
                                          "exercise/8.28 on the move of book/8.2.2, which asks the flux to "
                                          "fall faster than the law can bear",
                                          "singular amid the move", "servo"},
                                         kDirect, kWeakenedFlux, kServoMove),
      preset<QuadratureIntegratorController>(
          {"exercise/8.29",
           "Chiasson 2005, exercise 29 of chapter 8: dynamic linearisation, integrator on the q axis, "
           "lifting a "
           "hoist; gains ours",
           "peak error in the move below 3 counts, never singular once the load hangs", "servo-hoist"},
          kQuadrature, kConstantFlux, kHoistMove, kHoistTiming),
      preset<QuadratureIntegratorController>(
          {"exercise/8.29-no-load",
           "exercise/8.29 on the move of book/8.2.2, where the torque passes through zero",
           "singular at rest and amid the move", "servo"},
          kQuadrature, kConstantFlux, kServoMove),
      preset_of(
          {"exercise/8.30",
           "Chiasson 2005, exercise 30 of chapter 8: along the flat outputs, shaft angle and constant slip, "
           "lifting a hoist; gains and slip ours",
           "peak error in the move below 3 counts; both currents alike while it holds", "servo-hoist"},
          induction_needs(kServoDrive8Khz, kServoDrive8Khz.motor.machine.pole_pairs), flat_run,
          kServoDrive8Khz, kFlat, kHoistMove, kHoistTiming),
  };
}

}  // namespace drivebench::control::induction_linearization_presets
