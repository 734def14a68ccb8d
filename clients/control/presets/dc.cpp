#include <array>
#include <numbers>
#include <string_view>
#include <vector>

#include "clients/control/dc/dc_nested_loops.hpp"
#include "clients/control/dc/dc_sine_loop.hpp"
#include "clients/control/dc/dc_speed_loop.hpp"
#include "clients/control/dc/dc_tachometer_loop.hpp"
#include "clients/control/moves/speed_ramp.hpp"
#include "clients/control/moves/standard_inputs.hpp"
#include "clients/control/presets/dc_preset.hpp"
#include "clients/control/presets/presets_families.hpp"

namespace drivebench::control::dc_presets {
namespace {

constexpr double kPi = std::numbers::pi;

/// DC-A of problem 2.1: 40 V, 5 A, 2000 counts.
constexpr DcMachineModel kDcA = {.resistance_ohm = 2.0,
                                 .inductance_h = 2e-3,
                                 .torque_constant_nm_per_a = 0.07,
                                 .inertia_kgm2 = 6e-5,
                                 .friction_nms = 4e-4};
constexpr double kFriction = kDcA.friction_rate_per_s();
constexpr CurrentGains kPi20 = {.proportional_v_per_a = 20.0, .integral_v_per_as = 20e3};

constexpr DcAxisParameters kAxis = {
    .machine = kDcA,
    .sample_rate_hz = 10e3,
    .current_limit_a = 5.0,
    .voltage_limit_v = 40.0,
    .current = kPi20,
    .shaft = {.counts_per_revolution = 2000.0,
              .source = ShaftSpeed::kObserver,
              .observer = ShaftObserverGains::placed(std::array{500.0, 500.0}, kFriction)}};
constexpr DcAxisParameters kOwnAxis = with(kAxis, &DcAxisParameters::drive, DcDrive::kOwnRegulator);
constexpr DcAxisParameters kFastAxis = with(kOwnAxis, &DcAxisParameters::sample_rate_hz, 50e3);

/// The axis with another source of its speed.
constexpr DcAxisParameters with_speed(const DcAxisParameters& axis, ShaftSpeed source) noexcept {
  return with(axis, &DcAxisParameters::shaft, with(axis.shaft, &ShaftEstimatorParameters::source, source));
}
/// With the load observer, exact, three poles at -p.
constexpr DcAxisParameters with_load_observer(const DcAxisParameters& axis, double p_per_s) noexcept {
  using S = ShaftEstimatorParameters;
  return with(axis, &DcAxisParameters::shaft,
              with(axis.shaft, &S::source, ShaftSpeed::kLoadObserver, &S::observer,
                   ShaftObserverGains::placed(std::array{p_per_s, p_per_s, p_per_s}, kFriction),
                   &S::discretisation, Discretisation::kExact));
}
constexpr DcAxisParameters kLoadAxis = with_load_observer(kAxis, 500.0);

constexpr RunTiming kTiming = {.sample_rate_hz = 10e3, .prepare_s = 0.002, .hold_s = 0.055};
constexpr RunTiming kLongHold = {.sample_rate_hz = 10e3, .prepare_s = 0.002, .hold_s = 0.2};
constexpr RunTiming kNoTiming = {.sample_rate_hz = 10e3, .prepare_s = 0.0, .hold_s = 0.0};

// The current loop alone.
constexpr DcOpenLoopParameters kSinePi = {.axis = kFastAxis};
constexpr DcOpenLoopParameters kSineP = {.axis =
                                             with(kFastAxis, &DcAxisParameters::current,
                                                  {.proportional_v_per_a = 20.0, .integral_v_per_as = 0.0})};
constexpr SineTorqueMoveParameters kSine = {.amplitude_rad_s2 = kDcA.acceleration_per_a(),  // 1 A
                                            .angular_frequency_rad_s = 2.0 * kPi / 0.065,
                                            .friction_rate_per_s = kFriction,
                                            .duration_s = 30 * 0.065};
constexpr DcOpenLoopParameters kOpenLoop = {.axis = kAxis};

// Speed.
constexpr DcSpeedLoopParameters kSpeedLoop = {.axis = kAxis, .proportional_as_per_rad = 100.0 * 6e-5 / 0.07};
constexpr StepMoveParameters kSpeedStep = {.distance_rad = 0.0, .speed_rad_s = 50.0, .duration_s = 0.3};

// State feedback.
constexpr ServoGains kState100 = ServoGains::placed(placed_polynomial<3>({100.0, 100.0, 100.0}), kFriction);
constexpr ServoGains kNoIntegral100 = ServoGains::placed(placed_polynomial<2>({100.0, 100.0}), kFriction);
constexpr DcStateFeedbackParameters servo(const DcAxisParameters& axis,
                                          const ServoGains& gains = kState100) noexcept {
  return {.axis = axis, .position = gains};
}
constexpr DcStateFeedbackParameters kServo = servo(kAxis);
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
    .axis = with_load_observer(kOwnAxis, 1500.0),
    .position = DcVoltageGains::placed(placed_polynomial<4>({300.0, 300.0, 300.0, 300.0}), kDcA)};

// Nested loops.
constexpr DcNestedLoopsParameters nested(double r_per_s, const DcAxisParameters& axis) noexcept {
  return {.axis = axis,
          .loops = DcNestedGains::placed(placed_polynomial<3>({r_per_s, r_per_s, r_per_s}), kDcA)};
}
constexpr DcNestedLoopsParameters with_both_integrals() noexcept {
  const DcNestedLoopsParameters p = nested(100.0, kOwnAxis);
  return with(p, &DcNestedLoopsParameters::loops,
              with(p.loops, &DcNestedGains::speed_integral_a_per_rad, 5.0));
}
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

template <class ControllerType, class Move, class P, class Path>
Preset preset(std::string_view name, std::string_view source, std::string_view expectation, const P& p,
              const Path& path, const RunTiming& timing = kTiming, std::string_view bench = "dc-a-servo",
              Quantity quantity = Quantity::kCurrent) {
  return dc_preset<ControllerType, Move>({name, source, expectation, bench}, "pm_dc", quantity, p, path,
                                         timing);
}

}  // namespace

std::vector<Preset> all() {
  return {
      preset<DcOpenLoop, SineTorqueMove>(
          "book/2.9", "Chiasson 2005, problem 2.9: sine of 1 A, 65 ms, PI with K_P = 20 and alpha = 1000",
          "i/i_r = 0.9959 at -0.55 degrees", kSinePi, kSine, kNoTiming, "dc-a-fast", Quantity::kVoltage),
      preset<DcOpenLoop, SineTorqueMove>("book/2.9-p", "as book/2.9 with the P loop",
                                         "i/i_r = 0.9063 at 1.68 degrees", kSineP, kSine, kNoTiming,
                                         "dc-a-fast", Quantity::kVoltage),
      preset<DcSpeedLoop, StepMove>(
          "book/2.10",
          "Chiasson 2005, problem 2.10: proportional speed loop, K K_T/J = 100, a step to 50 rad/s",
          "3.125 rad/s are missed", kSpeedLoop, kSpeedStep, kNoTiming),
      preset<DcStateFeedback, JerkContinuousMove>(
          "book/2.17", "Chiasson 2005, problem 2.17: half a turn in 70 ms with a continuous jerk",
          "peak error below 0.015 rad, final at most 2 counts", kServo, kSmoothHalfTurn),
      preset<DcStateFeedback, CubicMove>(
          "book/2.18",
          "Chiasson 2005, problem 2.18: half a turn in 65 ms, state feedback with integrator, r = 100",
          "peak error at most 0.015 rad, final at most 2 counts, below 5 A and 40 V", kServo, kHalfTurn),
      preset<DcStateFeedback, CubicMove>(
          "book/2.18-own-current-loop", "as book/2.18 with the PI current loop in the controller, at 10 kHz",
          "peak error at most 0.015 rad, final at most 2 counts, below 5 A and 40 V", servo(kOwnAxis),
          kHalfTurn, kTiming, "dc-a-voltage", Quantity::kVoltage),
      preset<DcStateFeedback, CubicMove>(
          "book/2.18-load-observer", "as book/2.18 with the speed of the three-state observer",
          "peak error at most 0.015 rad, final at most 2 counts", servo(kLoadAxis), kHalfTurn),
      preset<DcStateFeedback, CubicMove>("book/2.18-edges",
                                         "as book/2.18 with the speed from the times of the encoder's edges",
                                         "peak error at most 0.015 rad, final at most 2 counts",
                                         servo(with_speed(kAxis, ShaftSpeed::kEdges)), kHalfTurn),
      preset<DcStateFeedback, CubicMove>(
          "book/2.18-raw-speed", "as book/2.18 with the speed by backward difference: a mistake",
          "steps of 31.4 rad/s make the current jump by 7.9 A: it stands at its limit",
          servo(with_speed(kAxis, ShaftSpeed::kBackwardDifference)), kHalfTurn),
      preset<DcOpenLoop, CubicMove>(
          "book/2.19-open-loop",
          "Chiasson 2005, problem 2.19 (a-d): 30 rad in 0.5 s by the current of the reference",
          "an error of the start or a load stays or grows", kOpenLoop, kLongMove),
      preset<DcStateFeedback, CubicMove>(
          "book/2.19", "Chiasson 2005, problem 2.19 (e): 30 rad in 0.5 s with feedback, r = 100",
          "peak error below 0.015 rad without a load, 0.034 rad with 0.035 N*m", kServo, kLongMove),
      preset<DcStateFeedback, StepMove>(
          "book/2.19-offset", "Chiasson 2005, problem 2.19 (e): 0.1 rad away from the reference",
          "-2.571 A at once, overshoot 0.025 rad at 30 ms", kServo, kOffset, kNoTiming),
      preset<DcStateFeedback, StepMove>(
          "book/2.21", "Chiasson 2005, problem 2.21: held against a load by the integrator, true speed",
          "a load of 0.035 N*m moves it by 0.0158 rad, which goes", servo(kLoadAxis), kRest, kNoTiming),
      preset<DcStateFeedback, StepMove>(
          "book/2.21-observer", "as book/2.21 with the two-state observer, which the load deceives",
          "a load of 0.035 N*m moves it by 0.034 rad, which goes", kServo, kRest, kNoTiming),
      preset<DcStateFeedback, StepMove>("book/2.21-no-integral", "as book/2.21-observer without integrator",
                                        "a load of 0.035 N*m leaves 0.103 rad", servo(kAxis, kNoIntegral100),
                                        kRest, kNoTiming),
      preset<DcVoltageFeedback, CubicMove>(
          "book/2.23",
          "Chiasson 2005, problem 2.23: half a turn, state feedback to the voltage, poles at -300",
          "peak error at most 0.015 rad, final at most 2 counts", kVoltageServo, kHalfTurn, kTiming,
          "dc-a-voltage", Quantity::kVoltage),
      preset<DcNestedLoops, TrapezoidalMove>(
          "book/2.24", "Chiasson 2005, problem 2.24: nested loops at a constant 500 rad/s^2, r = 100",
          "0.15 rad behind", nested(100.0, kAxis), kAcceleration),
      preset<DcNestedLoops, TrapezoidalMove>(
          "book/2.25",
          "Chiasson 2005, problem 2.25: half a turn in 65 ms at +-2974 rad/s^2, nested loops, r = 100",
          "fails: 0.64 rad behind, not there after 70 ms", nested(100.0, kAxis), kHalfTurnWithoutCruise),
      preset<DcNestedLoops, TrapezoidalMove>("book/2.25-300", "as book/2.25 with r = 300",
                                             "fails: 0.1 rad behind, not there after 70 ms",
                                             nested(300.0, kAxis), kHalfTurnWithoutCruise),
      preset<DcNestedLoops, TrapezoidalMove>("book/2.25-500", "as book/2.25 with r = 500",
                                             "fails: limits of current and voltage are reached",
                                             nested(500.0, kAxis), kHalfTurnWithoutCruise),
      preset<DcStateFeedback, TrapezoidalMove>(
          "book/2.26", "Chiasson 2005, problem 2.26: the half turn of book/2.18 with trapezoidal speed",
          "peak error at most 0.03 rad, final at most 2 counts", kServo, kHalfTurn),
      preset<DcNestedLoops, CubicMove>(
          "book/2.27",
          "Chiasson 2005, problem 2.27: three nested PI loops, current, speed and position; gains ours",
          "an error of at most a/K_thI = 0.22 rad, final at most 4 counts", with_both_integrals(), kLongMove,
          kLongHold, "dc-a-voltage", Quantity::kVoltage),
      preset<DcTachometerLoop, StepMove>(
          "book/2-tachometer",
          "Chiasson 2005, appendix of chapter 2: K = 400, a = 5, K_t = 29 on 1/(s (s + 1))",
          "400 A at once, overshoot 32.8 % at 0.22 s", kTachometer, kRadian, kUnitTiming, "dc-unit"),
      preset<DcTachometerLoop, StepMove>(
          "book/2-proportional",
          "Chiasson 2005, appendix of chapter 2: K = 1 on 1/(s (s + 1)), turned at 0.3 rad/s",
          "0.3 rad behind", kProportional, kSlowTurn, kUnitTiming, "dc-unit"),
      preset<DcSineLoop, SineMove>(
          "book/2-sine",
          "Chiasson 2005, appendix of chapter 2: -0.6 (s - 0.25)/(s^2 + 1) on 1/(s (s + 1)) follows sin t",
          "the error dies with e^(-0.167 t)", kSineLoop, kUnitSine, kUnitTiming, "dc-unit"),
  };
}

}  // namespace drivebench::control::dc_presets
