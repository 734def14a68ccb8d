#include <array>
#include <cmath>
#include <numbers>

#include "clients/control/dc/dc_nested_loops.hpp"
#include "clients/control/dc/dc_sine_loop.hpp"
#include "clients/control/dc/dc_speed_loop.hpp"
#include "clients/control/dc/dc_tachometer_loop.hpp"
#include "clients/control/moves/jerk_continuous_move.hpp"
#include "clients/control/moves/standard_inputs.hpp"
#include "clients/control/moves/trapezoidal_move.hpp"
#include "clients/control/presets/dc_preset.hpp"
#include "clients/control/presets/presets_families.hpp"

namespace drivebench::control {
namespace {

constexpr double kPi = std::numbers::pi;

/// DC-A of problem 2.1: 40 V, 5 A, 2000 counts.
constexpr DcMachineModel kDcA = {.resistance_ohm = 2.0,
                                 .inductance_h = 2e-3,
                                 .torque_constant_nm_per_a = 0.07,
                                 .inertia_kgm2 = 6e-5,
                                 .friction_nms = 4e-4};
constexpr double kFriction = kDcA.friction_rate_per_s();
constexpr DcCurrentGains kPi20 = {.proportional_v_per_a = 20.0, .integral_v_per_as = 20e3};

constexpr DcAxisParameters axis_of(DcDrive drive, double sample_rate_hz, ShaftSpeed source,
                                   const ShaftObserverGains& observer, Discretisation how) noexcept {
  return {
      .machine = kDcA,
      .sample_rate_hz = sample_rate_hz,
      .current_limit_a = 5.0,
      .voltage_limit_v = 40.0,
      .drive = drive,
      .current = kPi20,
      .shaft = {
          .counts_per_revolution = 2000.0, .source = source, .observer = observer, .discretisation = how}};
}

constexpr ShaftObserverGains kObserver500 = ShaftObserverGains::placed(std::array{500.0, 500.0}, kFriction);
constexpr DcAxisParameters kAxis =
    axis_of(DcDrive::kCurrentAmplifier, 10e3, ShaftSpeed::kObserver, kObserver500, Discretisation::kEuler);
constexpr DcAxisParameters kOwnAxis =
    axis_of(DcDrive::kOwnRegulator, 10e3, ShaftSpeed::kObserver, kObserver500, Discretisation::kEuler);
constexpr DcAxisParameters kFastAxis =
    axis_of(DcDrive::kOwnRegulator, 50e3, ShaftSpeed::kObserver, kObserver500, Discretisation::kEuler);
constexpr DcAxisParameters kLoadAxis =
    axis_of(DcDrive::kCurrentAmplifier, 10e3, ShaftSpeed::kLoadObserver,
            ShaftObserverGains::placed(std::array{500.0, 500.0, 500.0}, kFriction), Discretisation::kExact);
constexpr DcAxisParameters kEdgeAxis =
    axis_of(DcDrive::kCurrentAmplifier, 10e3, ShaftSpeed::kEdges, kObserver500, Discretisation::kEuler);
constexpr DcAxisParameters kDifferenceAxis = axis_of(
    DcDrive::kCurrentAmplifier, 10e3, ShaftSpeed::kBackwardDifference, kObserver500, Discretisation::kEuler);
constexpr DcAxisParameters kVoltageAxis = axis_of(
    DcDrive::kOwnRegulator, 10e3, ShaftSpeed::kLoadObserver,
    ShaftObserverGains::placed(std::array{1500.0, 1500.0, 1500.0}, kFriction), Discretisation::kExact);

constexpr RunTiming kTiming = {.sample_rate_hz = 10e3, .prepare_s = 0.002, .hold_s = 0.055};
constexpr RunTiming kLongHold = {.sample_rate_hz = 10e3, .prepare_s = 0.002, .hold_s = 0.2};
constexpr RunTiming kNoTiming = {.sample_rate_hz = 10e3, .prepare_s = 0.0, .hold_s = 0.0};

// The current loop alone.
constexpr DcOpenLoopParameters kSinePi = {.axis = kFastAxis};
constexpr DcOpenLoopParameters proportional_only() noexcept {
  DcOpenLoopParameters p = kSinePi;
  p.axis.current.integral_v_per_as = 0.0;
  return p;
}
constexpr DcOpenLoopParameters kSineP = proportional_only();
constexpr SineTorqueMoveParameters kSine = {.amplitude_rad_s2 = kDcA.acceleration_per_a(),  // 1 A
                                            .angular_frequency_rad_s = 2.0 * kPi / 0.065,
                                            .friction_rate_per_s = kFriction,
                                            .duration_s = 30 * 0.065};
constexpr DcOpenLoopParameters kOpenLoop = {.axis = kAxis};

// Speed.
constexpr DcSpeedLoopParameters kSpeedLoop = {.axis = kAxis, .proportional_as_per_rad = 100.0 * 6e-5 / 0.07};
constexpr StepMoveParameters kSpeedStep = {.distance_rad = 0.0, .speed_rad_s = 50.0, .duration_s = 0.3};

// State feedback.
constexpr DcStateGains kState100 =
    DcStateGains::placed(placed_polynomial<3>({100.0, 100.0, 100.0}), kFriction);
constexpr DcStateGains kNoIntegral100 = DcStateGains::placed(placed_polynomial<2>({100.0, 100.0}), kFriction);
constexpr DcStateFeedbackParameters kServo = {.axis = kAxis, .position = kState100};
constexpr DcStateFeedbackParameters kOwnServo = {.axis = kOwnAxis, .position = kState100};
constexpr DcStateFeedbackParameters kLoadServo = {.axis = kLoadAxis, .position = kState100};
constexpr DcStateFeedbackParameters kEdgeServo = {.axis = kEdgeAxis, .position = kState100};
constexpr DcStateFeedbackParameters kDifferenceServo = {.axis = kDifferenceAxis, .position = kState100};
constexpr DcStateFeedbackParameters kNoIntegralServo = {.axis = kAxis, .position = kNoIntegral100};
constexpr TrajectoryParameters kHalfTurn = {
    .distance_rad = kPi, .ramp_up_s = 0.025, .cruise_s = 0.015, .ramp_down_s = 0.025};
/// 65 ms would take 5.006 A of it.
constexpr TrajectoryParameters kSmoothHalfTurn = {
    .distance_rad = kPi, .ramp_up_s = 0.030, .cruise_s = 0.010, .ramp_down_s = 0.030};
constexpr TrajectoryParameters kLongMove = {
    .distance_rad = 30.0, .ramp_up_s = 0.2, .cruise_s = 0.1, .ramp_down_s = 0.2};
constexpr StepMoveParameters kRest = {.distance_rad = 0.0, .speed_rad_s = 0.0, .duration_s = 0.6};
constexpr StepMoveParameters kOffset = {.distance_rad = -0.1, .speed_rad_s = 0.0, .duration_s = 0.3};

constexpr DcVoltageFeedbackParameters kVoltageServo = {
    .axis = kVoltageAxis,
    .position = DcVoltageGains::placed(placed_polynomial<4>({300.0, 300.0, 300.0, 300.0}), kDcA)};

// Nested loops.
constexpr DcNestedLoopsParameters nested(double r_per_s, const DcAxisParameters& axis) noexcept {
  return {.axis = axis,
          .loops = DcNestedGains::placed(placed_polynomial<3>({r_per_s, r_per_s, r_per_s}), kDcA)};
}
constexpr DcNestedLoopsParameters kNested100 = nested(100.0, kAxis);
constexpr DcNestedLoopsParameters kNested300 = nested(300.0, kAxis);
constexpr DcNestedLoopsParameters kNested500 = nested(500.0, kAxis);
constexpr DcNestedLoopsParameters with_both_integrals() noexcept {
  DcNestedLoopsParameters p = nested(100.0, kOwnAxis);
  p.loops.speed_integral_a_per_rad = 5.0;
  return p;
}
constexpr DcNestedLoopsParameters kNestedPi = with_both_integrals();
/// 500 rad/s² for 0.2 s.
constexpr TrajectoryParameters kAcceleration = {
    .distance_rad = 20.0, .ramp_up_s = 0.2, .cruise_s = 0.0, .ramp_down_s = 0.2};
constexpr TrajectoryParameters kHalfTurnWithoutCruise = {
    .distance_rad = kPi, .ramp_up_s = 0.0325, .cruise_s = 0.0, .ramp_down_s = 0.0325};

// The classical loops on 1/(s·(s + 1)).
constexpr DcMachineModel kUnit = {.resistance_ohm = 1.0,
                                  .inductance_h = 0.01,
                                  .torque_constant_nm_per_a = 1.0,
                                  .inertia_kgm2 = 1.0,
                                  .friction_nms = 1.0};
constexpr DcAxisParameters kUnitAxis = {
    .machine = kUnit,
    .sample_rate_hz = 1e3,
    .current_limit_a = 1000.0,
    .voltage_limit_v = 1e5,
    .shaft = {.counts_per_revolution = 1e5, .source = ShaftSpeed::kTachometer, .tachometer_vs_per_rad = 0.1}};
/// Poles at −10 and −10 ± j10.
constexpr DcTachometerLoopParameters kTachometer = {
    .axis = kUnitAxis, .loop = DcTachometerGains::placed(Polynomial<3>{30.0, 400.0, 2000.0}, kUnit)};
constexpr DcTachometerLoopParameters kProportional = {
    .axis = kUnitAxis, .loop = {.proportional_a_per_rad = 1.0, .zero_per_s = 0.0, .speed_as_per_rad = 0.0}};
constexpr StepMoveParameters kRadian = {.distance_rad = 1.0, .speed_rad_s = 0.0, .duration_s = 2.0};
constexpr StepMoveParameters kSlowTurn = {.distance_rad = 0.0, .speed_rad_s = 0.3, .duration_s = 30.0};
constexpr DcSineLoopParameters kSineLoop = {
    .axis = kUnitAxis,
    .loop = {.gain_a_s_per_rad = -0.6, .zero_per_s = -0.25, .angular_frequency_rad_s = 1.0}};
constexpr SineMoveParameters kUnitSine = {
    .amplitude_rad = 1.0, .angular_frequency_rad_s = 1.0, .duration_s = 40.0};
constexpr RunTiming kUnitTiming = {.sample_rate_hz = 1e3, .prepare_s = 0.0, .hold_s = 0.0};

template <class ControllerType, class Move, const auto& kP, const auto& kPath,
          const RunTiming& kWhen = kTiming>
constexpr Preset preset(std::string_view name, std::string_view source, std::string_view expectation,
                        std::string_view bench = "dc-a-servo", Quantity quantity = Quantity::kCurrent) {
  return dc_preset<ControllerType, Move, kP, kPath, kWhen>(name, source, expectation, bench, "pm_dc",
                                                           quantity);
}

constexpr auto kPresets = std::to_array<Preset>({
    preset<DcOpenLoop, SineTorqueMove, kSinePi, kSine, kNoTiming>(
        "book/2.9", "Chiasson 2005, problem 2.9: sine of 1 A, 65 ms, PI with K_P = 20 and alpha = 1000",
        "i/i_r = 0.9959 at -0.55 degrees", "dc-a-fast", Quantity::kVoltage),
    preset<DcOpenLoop, SineTorqueMove, kSineP, kSine, kNoTiming>("book/2.9-p", "as book/2.9 with the P loop",
                                                                 "i/i_r = 0.9063 at 1.68 degrees",
                                                                 "dc-a-fast", Quantity::kVoltage),
    preset<DcSpeedLoop, StepMove, kSpeedLoop, kSpeedStep, kNoTiming>(
        "book/2.10",
        "Chiasson 2005, problem 2.10: proportional speed loop, K K_T/J = 100, a step to 50 rad/s",
        "3.125 rad/s are missed"),
    preset<DcStateFeedback, JerkContinuousMove, kServo, kSmoothHalfTurn>(
        "book/2.17", "Chiasson 2005, problem 2.17: half a turn in 70 ms with a continuous jerk",
        "peak error below 0.015 rad, final at most 2 counts"),
    preset<DcStateFeedback, CubicMove, kServo, kHalfTurn>(
        "book/2.18",
        "Chiasson 2005, problem 2.18: half a turn in 65 ms, state feedback with integrator, r = 100",
        "peak error at most 0.015 rad, final at most 2 counts, below 5 A and 40 V"),
    preset<DcStateFeedback, CubicMove, kOwnServo, kHalfTurn>(
        "book/2.18-own-current-loop", "as book/2.18 with the PI current loop in the controller, at 10 kHz",
        "peak error at most 0.015 rad, final at most 2 counts, below 5 A and 40 V", "dc-a-voltage",
        Quantity::kVoltage),
    preset<DcStateFeedback, CubicMove, kLoadServo, kHalfTurn>(
        "book/2.18-load-observer", "as book/2.18 with the speed of the three-state observer",
        "peak error at most 0.015 rad, final at most 2 counts"),
    preset<DcStateFeedback, CubicMove, kEdgeServo, kHalfTurn>(
        "book/2.18-edges", "as book/2.18 with the speed from the times of the encoder's edges",
        "peak error at most 0.015 rad, final at most 2 counts"),
    preset<DcStateFeedback, CubicMove, kDifferenceServo, kHalfTurn>(
        "book/2.18-raw-speed", "as book/2.18 with the speed by backward difference: a mistake",
        "steps of 31.4 rad/s make the current jump by 7.9 A: it stands at its limit"),
    preset<DcOpenLoop, CubicMove, kOpenLoop, kLongMove>(
        "book/2.19-open-loop",
        "Chiasson 2005, problem 2.19 (a-d): 30 rad in 0.5 s by the current of the reference",
        "an error of the start or a load stays or grows"),
    preset<DcStateFeedback, CubicMove, kServo, kLongMove>(
        "book/2.19", "Chiasson 2005, problem 2.19 (e): 30 rad in 0.5 s with feedback, r = 100",
        "peak error below 0.015 rad without a load, 0.034 rad with 0.035 N*m"),
    preset<DcStateFeedback, StepMove, kServo, kOffset, kNoTiming>(
        "book/2.19-offset", "Chiasson 2005, problem 2.19 (e): 0.1 rad away from the reference",
        "-2.571 A at once, overshoot 0.025 rad at 30 ms"),
    preset<DcStateFeedback, StepMove, kLoadServo, kRest, kNoTiming>(
        "book/2.21", "Chiasson 2005, problem 2.21: held against a load by the integrator, true speed",
        "a load of 0.035 N*m moves it by 0.0158 rad, which goes"),
    preset<DcStateFeedback, StepMove, kServo, kRest, kNoTiming>(
        "book/2.21-observer", "as book/2.21 with the two-state observer, which the load deceives",
        "a load of 0.035 N*m moves it by 0.034 rad, which goes"),
    preset<DcStateFeedback, StepMove, kNoIntegralServo, kRest, kNoTiming>(
        "book/2.21-no-integral", "as book/2.21-observer without integrator",
        "a load of 0.035 N*m leaves 0.103 rad"),
    preset<DcVoltageFeedback, CubicMove, kVoltageServo, kHalfTurn>(
        "book/2.23", "Chiasson 2005, problem 2.23: half a turn, state feedback to the voltage, poles at -300",
        "peak error at most 0.015 rad, final at most 2 counts", "dc-a-voltage", Quantity::kVoltage),
    preset<DcNestedLoops, TrapezoidalMove, kNested100, kAcceleration>(
        "book/2.24", "Chiasson 2005, problem 2.24: nested loops at a constant 500 rad/s^2, r = 100",
        "0.15 rad behind"),
    preset<DcNestedLoops, TrapezoidalMove, kNested100, kHalfTurnWithoutCruise>(
        "book/2.25",
        "Chiasson 2005, problem 2.25: half a turn in 65 ms at +-2974 rad/s^2, nested loops, r = 100",
        "fails: 0.64 rad behind, not there after 70 ms"),
    preset<DcNestedLoops, TrapezoidalMove, kNested300, kHalfTurnWithoutCruise>(
        "book/2.25-300", "as book/2.25 with r = 300", "fails: 0.1 rad behind, not there after 70 ms"),
    preset<DcNestedLoops, TrapezoidalMove, kNested500, kHalfTurnWithoutCruise>(
        "book/2.25-500", "as book/2.25 with r = 500", "fails: limits of current and voltage are reached"),
    preset<DcStateFeedback, TrapezoidalMove, kServo, kHalfTurn>(
        "book/2.26", "Chiasson 2005, problem 2.26: the half turn of book/2.18 with trapezoidal speed",
        "peak error at most 0.03 rad, final at most 2 counts"),
    preset<DcNestedLoops, CubicMove, kNestedPi, kLongMove, kLongHold>(
        "book/2.27",
        "Chiasson 2005, problem 2.27: three nested PI loops, current, speed and position; gains ours",
        "an error of at most a/K_thI = 0.22 rad, final at most 4 counts", "dc-a-voltage", Quantity::kVoltage),
    preset<DcTachometerLoop, StepMove, kTachometer, kRadian, kUnitTiming>(
        "book/2-tachometer",
        "Chiasson 2005, appendix of chapter 2: K = 400, a = 5, K_t = 29 on 1/(s (s + 1))",
        "400 A at once, overshoot 32.8 % at 0.22 s", "dc-unit"),
    preset<DcTachometerLoop, StepMove, kProportional, kSlowTurn, kUnitTiming>(
        "book/2-proportional",
        "Chiasson 2005, appendix of chapter 2: K = 1 on 1/(s (s + 1)), turned at 0.3 rad/s", "0.3 rad behind",
        "dc-unit"),
    preset<DcSineLoop, SineMove, kSineLoop, kUnitSine, kUnitTiming>(
        "book/2-sine",
        "Chiasson 2005, appendix of chapter 2: -0.6 (s - 0.25)/(s^2 + 1) on 1/(s (s + 1)) follows sin t",
        "the error dies with e^(-0.167 t)", "dc-unit"),
});

}  // namespace

std::span<const Preset> dc_presets() noexcept {
  return kPresets;
}

}  // namespace drivebench::control
