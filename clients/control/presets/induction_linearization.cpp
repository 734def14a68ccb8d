#include <array>
#include <memory>
#include <numbers>
#include <tuple>

#include "clients/control/direct_integrator_controller.hpp"
#include "clients/control/induction_demands.hpp"
#include "clients/control/move_allowance.hpp"
#include "clients/control/presets/presets_families.hpp"
#include "clients/control/quadrature_integrator_controller.hpp"
#include "clients/control/torque_optimal_move.hpp"
#include "clients/control/voltage_linearization_controller.hpp"

// The linearisations of an induction machine that the book gives equations for but no experiment: with
// voltage command, and with an integrator before either current. Gains and moves are ours.
namespace drivebench::control {
namespace {

/// The book's 1/12 hp two-phase servo motor (8.2.2) at 8 kHz.
constexpr InductionDriveParameters kDrive = {.motor = {.machine = {.pole_pairs = 3.0,
                                                                   .mutual_inductance_h = 0.0117,
                                                                   .rotor_resistance_ohm = 3.9,
                                                                   .rotor_inductance_h = 0.014,
                                                                   .friction_nms = 1.4e-4,
                                                                   .inertia_kgm2 = 1.1e-4},
                                                       .stator_resistance_ohm = 1.7,
                                                       .stator_inductance_h = 0.014},
                                             .sample_rate_hz = 8000.0,
                                             .counts_per_revolution = 2000.0,
                                             .voltage_limit_v = 80.0,
                                             .current_limit_a = 6.0,
                                             .quadrature_reference_limit_a = 8.0,
                                             .speed_observer = {.angle_per_s = 1.8e3, .speed_per_s2 = 8e5}};

constexpr InductionDriveParameters frictionless() noexcept {
  InductionDriveParameters p = kDrive;
  p.motor.machine.friction_nms = 0.0;
  return p;
}
constexpr InductionDriveParameters kFrictionless = frictionless();

constexpr VoltageLinearizationParameters kVoltage =
    VoltageLinearizationParameters::placed(250.0, 300.0, 1.4e-4 / 1.1e-4);

/// Current gains of 8.2.5, for loops that are quick against what stands around them.
constexpr CurrentLoopGains kCurrent = {.proportional_v_per_a = 15.0, .integral_v_per_as = 9000.0};

constexpr DirectIntegratorParameters kDirect = {
    .current = kCurrent,
    .position = {.integral_per_s3 = 3.0e5, .proportional_per_s2 = 5.5e4, .derivative_per_s = 400.0},
    .flux_proportional_per_s2 = 4e4,
    .flux_derivative_per_s = 400.0,
    .least_distance = 0.1};

constexpr QuadratureIntegratorParameters kQuadrature = {.current = kCurrent,
                                                        .angle_pole_per_s = 200.0,
                                                        .slip_pole_per_s = 200.0,
                                                        .load_pole_per_s = 300.0,
                                                        .least_i_q_a = 0.3};

constexpr double kRatedFluxWb = 0.0117 * 5.5 / std::numbers::sqrt2;
constexpr FluxReferenceParameters kConstantFlux = {
    .rated_flux_wb = kRatedFluxWb, .base_speed_rad_s = 300.0, .policy = FluxPolicy::kConstant};
constexpr FluxReferenceParameters kWeakenedFlux = {
    .rated_flux_wb = kRatedFluxWb, .base_speed_rad_s = 250.0, .policy = FluxPolicy::kFieldWeakening};
constexpr FluxReferenceParameters kOptimumFlux = {
    .rated_flux_wb = kRatedFluxWb, .base_speed_rad_s = 300.0, .policy = FluxPolicy::kOptimumTorque};

/// Profile A of book/8.2.2.
constexpr TrajectoryParameters kMoveA = {
    .distance_rad = std::numbers::pi, .ramp_up_s = 0.030, .cruise_s = 0.013, .ramp_down_s = 0.030};
/// Slow enough that the motor never stops lifting 0.25 N·m.
constexpr TrajectoryParameters kHoistMove = {
    .distance_rad = std::numbers::pi, .ramp_up_s = 0.050, .cruise_s = 0.020, .ramp_down_s = 0.050};
/// ω_max = 838 rad/s, as in exercise 15(b).
constexpr TrajectoryParameters kFastMove = {
    .distance_rad = 838.0 * 1.6, .ramp_up_s = 1.5, .cruise_s = 0.1, .ramp_down_s = 1.5};
/// Of book/8.2.5.
constexpr TorqueMoveParameters k8000Rpm = {.top_speed_rad_s = 8000.0 * 2.0 * std::numbers::pi / 60.0,
                                           .run_up_s = 0.38,
                                           .run_down_s = 0.265,
                                           .torque_ramp_s = 0.030};

constexpr RunTiming kTiming = {.sample_rate_hz = 8000.0, .prepare_s = 0.05, .hold_s = 0.05};
/// The load needs time to settle in.
constexpr RunTiming kHoistTiming = {.sample_rate_hz = 8000.0, .prepare_s = 0.25, .hold_s = 0.1};
constexpr MoveAllowance kAmplifier = {.voltage_v = 80.0, .current_a = 6.0};

void refuse_beyond(const InductionDriveParameters& drive, const FluxReference& flux, const Trajectory& move,
                   const MoveAllowance& allowed) {
  refuse(first_exceeded(move, flux, drive.period_s(), InductionDemands(drive.motor, allowed)));
}

template <class C, const InductionDriveParameters& kP, const auto& kLaw, const FluxReferenceParameters& kFlux,
          const TrajectoryParameters& kMove, const RunTiming& kWhen>
struct CubicPreset {
  static std::vector<Gain> gains() { return gains_of(kP, kLaw, kFlux, kMove, kAmplifier, kWhen); }
  static Run make(std::span<const Gain> overrides) {
    auto [drive, law, flux, move, allowed, timing] =
        with_gains(std::tuple{kP, kLaw, kFlux, kMove, kAmplifier, kWhen}, overrides);
    timing.sample_rate_hz = drive.sample_rate_hz;
    const auto trajectory = std::make_shared<const CubicMove>(move);
    refuse_beyond(drive, FluxReference(flux, drive.motor.machine, drive.period_s()), *trajectory, allowed);
    return {std::make_unique<C>(drive, law, flux), trajectory, timing};
  }
};

/// The direct integrator on the move to 8000 rpm.
struct FastPreset {
  static std::vector<Gain> gains() { return gains_of(kFrictionless, kDirect, k8000Rpm, kAmplifier, kTiming); }
  static Run make(std::span<const Gain> overrides) {
    auto [drive, law, move, allowed, timing] =
        with_gains(std::tuple{kFrictionless, kDirect, k8000Rpm, kAmplifier, kTiming}, overrides);
    timing.sample_rate_hz = drive.sample_rate_hz;
    const auto optimum = std::make_shared<const OptimumTorqueTable>(
        SteadyInductionModel::of(drive.motor),
        VectorLimits{.voltage_v = drive.voltage_limit_v, .current_a = drive.current_limit_a},
        move.top_speed_rad_s);
    const auto trajectory = std::make_shared<const TorqueOptimalMove>(move, *optimum, drive.motor.machine);
    FluxReferenceParameters flux = kOptimumFlux;
    flux.motoring_share = trajectory->motoring_share();
    flux.generating_share = trajectory->generating_share();
    refuse_beyond(drive, FluxReference(flux, drive.motor.machine, drive.period_s(), optimum), *trajectory,
                  allowed);
    return {std::make_unique<DirectIntegratorController>(drive, law, flux, optimum), trajectory, timing};
  }
};

template <class Family>
constexpr Preset preset(std::string_view name, std::string_view source, std::string_view expectation,
                        std::string_view bench) {
  return {.name = name,
          .source = source,
          .expectation = expectation,
          .bench = bench,
          .needs = {.machine_kind = "induction",
                    .counts_per_revolution = 2000.0,
                    .pole_pairs = 3.0,
                    .voltage_limit_v = 80.0},
          .gains = Family::gains,
          .make = Family::make};
}

constexpr auto kPresets = std::to_array<Preset>({
    preset<CubicPreset<VoltageLinearizationController, kDrive, kVoltage, kConstantFlux, kMoveA, kTiming>>(
        "book/8.2.5-voltage",
        "Chiasson 2005, (8.33): input-output linearisation with voltage command, on the move of book/8.2.2; "
        "gains ours",
        "peak error below 3 counts, no current loop", "servo"),
    preset<
        CubicPreset<DirectIntegratorController, kFrictionless, kDirect, kWeakenedFlux, kFastMove, kTiming>>(
        "exercise/8.28",
        "Chiasson 2005, exercise 28 of chapter 8: dynamic linearisation, integrator on the d axis, on the "
        "move of "
        "exercise/8.15b; gains ours",
        "peak error below 3 counts, never singular", "servo-frictionless"),
    preset<FastPreset>("exercise/8.28-8000rpm", "exercise/8.28 on the move of book/8.2.5",
                       "meets the singularity", "servo-frictionless"),
    preset<CubicPreset<QuadratureIntegratorController, kDrive, kQuadrature, kConstantFlux, kHoistMove,
                       kHoistTiming>>("exercise/8.29",
                                      "Chiasson 2005, exercise 29 of chapter 8: dynamic linearisation, "
                                      "integrator on the q axis, lifting a hoist; "
                                      "gains ours",
                                      "peak error below 5 counts, never singular once the load hangs",
                                      "servo-hoist"),
    preset<CubicPreset<QuadratureIntegratorController, kDrive, kQuadrature, kConstantFlux, kMoveA, kTiming>>(
        "exercise/8.29-no-load",
        "exercise/8.29 on the move of book/8.2.2, where the torque passes through zero",
        "singular at rest and amid the move", "servo"),
});

}  // namespace

std::span<const Preset> induction_linearization_presets() noexcept {
  return kPresets;
}

}  // namespace drivebench::control
