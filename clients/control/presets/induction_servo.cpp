#include "clients/control/presets/induction_servo.hpp"

#include <memory>
#include <vector>

#include "clients/control/presets/presets_families.hpp"

namespace drivebench::control::induction_servo_presets {
namespace {

using P = ControllerParameters;

/// The other observers of the flux in place of the polar one. The estimate starts at 20 mWb where the machine
/// has none, so that a plot shows how fast each one finds the truth.
constexpr P on_flux_of(FluxEstimatorParameters observer) noexcept {
  observer.start_wb = 0.020;
  return with(kServoController, &P::flux_observer, observer);
}
constexpr double kStator_ohm = kServoDrive8Khz.motor.stator_resistance_ohm;
constexpr double kStator_h = kServoDrive8Khz.motor.stator_inductance_h;
constexpr P kOnVergheseSanders = on_flux_of({.source = FluxSource::kVergheseSanders,
                                             .stator_resistance_ohm = kStator_ohm,
                                             .stator_inductance_h = kStator_h,
                                             .correction = 0.9});
/// Errors that decay at 500 and 700 1/s, R_R·r. At 8 kHz faster ones take the current, held over a sample,
/// for an error of the flux: 8 mWb in the move with 1000 and 1400 1/s, 2.4 mWb with these.
constexpr P kOnMartinRouchon = on_flux_of({.source = FluxSource::kMartinRouchon,
                                           .stator_resistance_ohm = kStator_ohm,
                                           .stator_inductance_h = kStator_h,
                                           .first_rate_per_h = 500.0 / 3.9,
                                           .second_rate_per_h = 700.0 / 3.9});
constexpr P kOnRotorFrame = on_flux_of({.source = FluxSource::kRotorFrame, .load_pole_per_s = 300.0});

/// Poles at −76, −200 and −525 1/s: slow enough for the current loop, which passes on 0.59 of a quick
/// reference.
constexpr P kNested = with(kServoController, &P::law, PositionLaw::kNested, &P::nested,
                           NestedServoGains{.angle_proportional_per_s = 100.0,
                                            .speed_proportional_per_s = 800.0,
                                            .speed_integral_per_s2 = 8e4,
                                            .speed_limit_rad_s = 100.0});

/// 25 ms bring ψ to within 0.1 % of its rated value.
constexpr RunTiming kTiming = {.sample_rate_hz = 8000.0, .prepare_s = 0.025, .hold_s = 0.030};
/// The slowest pole of the nested loops needs longer.
constexpr RunTiming kNestedTiming = with(kTiming, &RunTiming::hold_s, 0.20);

Run run(const ControllerParameters& p, const TrajectoryParameters& move, const RunTiming& timing) {
  return run_at(p.sample_rate_hz, std::make_unique<FieldOrientedController>(p),
                std::make_shared<CubicMove>(move), timing);
}

Preset preset(const PresetText& text, const ControllerParameters& p,
              const TrajectoryParameters& move = kServoMove, const RunTiming& timing = kTiming) {
  return preset_of(text, induction_needs(p, p.machine.pole_pairs), run, p, move, timing);
}

}  // namespace

std::vector<Preset> all() {
  constexpr P kClipped = with(kServoController, &P::quadrature_clip, QuadratureClip::kCircular);
  return {
      preset({"book/8.2.2", "Chiasson 2005, 8.2.2: field-oriented 180 degree move; profile A (30, 13, 30 ms)",
              "peak error at most 2 counts, final 0 to 1", "servo"},
             kServoController),
      preset(
          {"book/8.2.2-profile-b", "as book/8.2.2 with the profile of exercise 15: 75 rad/s, ramps of 25 ms",
           "peak error about 2 counts, peak phase current above 6 A", "servo"},
          kServoController, kMoveOfExercise15),
      preset({"book/8.2.2-4khz", "as book/8.2.2 at half the sample rate, same gains",
              "peak error at most 2 counts", "servo-4khz"},
             with(kServoController, &P::sample_rate_hz, 4000.0)),
      preset({"book/8.2.2-clipped",
              "as book/8.2.2, i_q reference clipped to the current circle: a mistake, kept as a negative "
              "example",
              "fails: peak error above 5 counts", "servo"},
             kClipped),
      preset({"book/8.2.2-backward-difference",
              "as book/8.2.2, speed by backward difference: a mistake, kept as a negative example",
              "fails: peak error above 5 counts, voltage touches its limit", "servo"},
             with(kServoController, &P::speed_source, SpeedSource::kBackwardDifference)),
      preset({"book/8.2.2-clipped-backward-difference", "as book/8.2.2 with both mistakes",
              "fails: peak error above 50 counts and growing", "servo"},
             with(kClipped, &P::speed_source, SpeedSource::kBackwardDifference)),
      preset(
          {"book/8.2.2-flux-copy",
           "as book/8.2.2 on the flux observer (8.35), exact over a sample (exercise 22), started 20 mWb off",
           "peak error at most 2 counts; the flux error decays with 3.6 ms", "servo"},
          on_flux_of({.source = FluxSource::kExactCopy})),
      preset({"book/8.2.2-flux-copy-euler", "the same by forward Euler (exercise 19)",
              "peak error at most 2 counts; unstable above 698 rad/s at 8 kHz", "servo"},
             on_flux_of({.source = FluxSource::kEulerCopy})),
      preset({"book/8.2.2-verghese-sanders",
              "as book/8.2.2 on the flux observer of Verghese and Sanders, (8.44)-(8.53), k = 0.9, started "
              "20 mWb off",
              "peak error at most 2 counts; the flux error decays with 0.9 ms", "servo"},
             kOnVergheseSanders),
      preset({"exercise/8.26",
              "Chiasson 2005, exercise 26 of chapter 8: book/8.2.2 on flux, speed and load observed in rotor "
              "coordinates, started 20 mWb off",
              "peak error at most 2 counts; finds a load of 0.1 N*m to 5 %", "servo"},
             kOnRotorFrame),
      preset({"exercise/8.27",
              "Chiasson 2005, exercise 27 of chapter 8: book/8.2.2 on the flux observer of Martin and "
              "Rouchon, errors at 500 and 700 1/s, started 20 mWb off",
              "peak error at most 2 counts; the flux error decays with 2 ms", "servo"},
             kOnMartinRouchon),
      preset({"exercise/8.17",
              "Chiasson 2005, exercise 17 of chapter 8: book/8.2.2 by nested P and PI loops; gains ours",
              "lags by the speed over 100 1/s, 0.73 rad in the cruise; final at most 1 count", "servo"},
             kNested, kServoMove, kNestedTiming),
      preset({"exercise/8.17-feed-forward", "exercise/8.17 with the speed of the reference fed forward",
              "peak error a tenth of that; final at most 1 count", "servo"},
             with(kNested, &P::nested, with(kNested.nested, &NestedServoGains::speed_share, 1.0)), kServoMove,
             kNestedTiming),
  };
}

}  // namespace drivebench::control::induction_servo_presets
