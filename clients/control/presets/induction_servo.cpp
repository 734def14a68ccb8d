#include "clients/control/presets/induction_servo.hpp"

#include <memory>
#include <vector>

#include "clients/control/presets/presets_families.hpp"

namespace drivebench::control {
namespace {

/// 25 ms bring ψ to within 0.1 % of its rated value.
constexpr RunTiming kTiming = {.sample_rate_hz = 8000.0, .prepare_s = 0.025, .hold_s = 0.030};

Run run(const ControllerParameters& p, const TrajectoryParameters& move, const RunTiming& timing) {
  return run_at(p.sample_rate_hz, std::make_unique<FieldOrientedController>(p),
                std::make_shared<CubicMove>(move), timing);
}

Preset preset(const PresetText& text, const ControllerParameters& p,
              const TrajectoryParameters& move = kServoMove) {
  return preset_of(text, induction_needs(p, p.machine.pole_pairs), run, p, move, kTiming);
}

}  // namespace

std::vector<Preset> induction_servo_presets() {
  using P = ControllerParameters;
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
  };
}

}  // namespace drivebench::control
