#include <array>
#include <memory>
#include <numbers>
#include <tuple>

#include "clients/control/gains/move_allowance.hpp"
#include "clients/control/induction/direct_integrator_controller.hpp"
#include "clients/control/induction/induction_demands.hpp"
#include "clients/control/induction/quadrature_integrator_controller.hpp"
#include "clients/control/induction/voltage_linearization_controller.hpp"
#include "clients/control/presets/presets_families.hpp"

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

constexpr double kRatedFluxWb = 0.0117 * 5.5 / std::numbers::sqrt2;
constexpr FluxReferenceParameters kConstantFlux = {
    .rated_flux_wb = kRatedFluxWb, .base_speed_rad_s = 300.0, .policy = FluxPolicy::kConstant};
constexpr FluxReferenceParameters kWeakenedFlux = {
    .rated_flux_wb = kRatedFluxWb, .base_speed_rad_s = 60.0, .policy = FluxPolicy::kFieldWeakening};

/// Profile A of book/8.2.2.
constexpr TrajectoryParameters kMoveA = {
    .distance_rad = std::numbers::pi, .ramp_up_s = 0.030, .cruise_s = 0.013, .ramp_down_s = 0.030};
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

using VoltagePreset =
    CubicPreset<VoltageLinearizationController, kDrive, kVoltage, kConstantFlux, kMoveA, kTiming>;
template <const TrajectoryParameters& kMove>
using DirectPreset = CubicPreset<DirectIntegratorController, kDrive, kDirect, kWeakenedFlux, kMove, kTiming>;
template <const TrajectoryParameters& kMove, const RunTiming& kWhen>
using QuadraturePreset =
    CubicPreset<QuadratureIntegratorController, kDrive, kQuadrature, kConstantFlux, kMove, kWhen>;

constexpr auto kPresets = std::to_array<Preset>({
    preset<VoltagePreset>(
        "book/8.2.5-voltage",
        "Chiasson 2005, (8.33): input-output linearisation with voltage command, on the move of "
        "book/8.2.2; gains ours",
        "peak error below 3 counts, without a current loop", "servo"),
    preset<DirectPreset<kWeakeningMove>>("exercise/8.28",
                                         "Chiasson 2005, exercise 28 of chapter 8: dynamic linearisation, "
                                         "integrator on the d axis, 73 rad/s with the "
                                         "flux falling from 60 rad/s on; gains and move ours",
                                         "peak error below 3 counts, never singular once the flux is up",
                                         "servo"),
    preset<DirectPreset<kMoveA>>(
        "exercise/8.28-singular",
        "exercise/8.28 on the move of book/8.2.2, which asks the flux to fall faster than the law can bear",
        "singular amid the move", "servo"),
    preset<QuadraturePreset<kHoistMove, kHoistTiming>>(
        "exercise/8.29",
        "Chiasson 2005, exercise 29 of chapter 8: dynamic linearisation, integrator on the q axis, lifting a "
        "hoist; "
        "gains ours",
        "peak error in the move below 3 counts, never singular once the load hangs", "servo-hoist"),
    preset<QuadraturePreset<kMoveA, kTiming>>(
        "exercise/8.29-no-load",
        "exercise/8.29 on the move of book/8.2.2, where the torque passes through zero",
        "singular at rest and amid the move", "servo"),
});

}  // namespace

std::span<const Preset> induction_linearization_presets() noexcept {
  return kPresets;
}

}  // namespace drivebench::control
