#include "clients/control/presets/induction_servo.hpp"

#include <array>
#include <numbers>

#include "clients/control/presets/presets_families.hpp"

namespace drivebench::control {
namespace {

/// ω_max = 75 rad/s: π/75 = 41.888 ms is t2.
constexpr TrajectoryParameters kMoveOfExercise15 = {.distance_rad = std::numbers::pi,
                                                    .ramp_up_s = 0.025,
                                                    .cruise_s = std::numbers::pi / 75.0 - 0.025,
                                                    .ramp_down_s = 0.025};

/// 25 ms bring ψ to within 0.1 % of its rated value.
constexpr RunTiming kTiming = {.sample_rate_hz = 8000.0, .prepare_s = 0.025, .hold_s = 0.030};

constexpr ControllerParameters with(double sample_rate_hz, SpeedSource source, QuadratureClip clip) noexcept {
  ControllerParameters p = kServoController;
  p.sample_rate_hz = sample_rate_hz;
  p.speed_source = source;
  p.quadrature_clip = clip;
  return p;
}

constexpr ControllerParameters k4Khz = with(4000.0, SpeedSource::kObserver, QuadratureClip::kFixed);
constexpr ControllerParameters kClipped = with(8000.0, SpeedSource::kObserver, QuadratureClip::kCircular);
constexpr ControllerParameters kDifference =
    with(8000.0, SpeedSource::kBackwardDifference, QuadratureClip::kFixed);
constexpr ControllerParameters kBothMistakes =
    with(8000.0, SpeedSource::kBackwardDifference, QuadratureClip::kCircular);

template <const ControllerParameters& kP, const TrajectoryParameters& kMove>
std::vector<Gain> gains() {
  return gains_of(kP, kMove, kTiming);
}

template <const ControllerParameters& kP, const TrajectoryParameters& kMove>
Run make(std::span<const Gain> overrides) {
  auto [p, move, timing] = with_gains(std::tuple{kP, kMove, kTiming}, overrides);
  timing.sample_rate_hz = p.sample_rate_hz;
  return {std::make_unique<FieldOrientedController>(p), std::make_shared<CubicMove>(move), timing};
}

template <const ControllerParameters& kP, const TrajectoryParameters& kMove>
constexpr Preset preset(std::string_view name, std::string_view source, std::string_view expectation,
                        std::string_view bench = "servo") {
  return {.name = name,
          .source = source,
          .expectation = expectation,
          .bench = bench,
          .needs = {.machine_kind = "induction",
                    .counts_per_revolution = kP.counts_per_revolution,
                    .pole_pairs = kP.machine.pole_pairs,
                    .voltage_limit_v = kP.voltage_limit_v},
          .gains = gains<kP, kMove>,
          .make = make<kP, kMove>};
}

constexpr auto kPresets = std::to_array<Preset>({
    preset<kServoController, kServoMove>(
        "book/8.2.2", "Chiasson 2005, 8.2.2: field-oriented 180 degree move; profile A (30, 13, 30 ms)",
        "peak error at most 2 counts, final 0 to 1"),
    preset<kServoController, kMoveOfExercise15>(
        "book/8.2.2-profile-b", "as book/8.2.2 with the profile of exercise 15: 75 rad/s, ramps of 25 ms",
        "peak error about 2 counts, peak phase current above 6 A"),
    preset<k4Khz, kServoMove>("book/8.2.2-4khz", "as book/8.2.2 at half the sample rate, same gains",
                              "peak error at most 2 counts", "servo-4khz"),
    preset<kClipped, kServoMove>(
        "book/8.2.2-clipped",
        "as book/8.2.2, i_q reference clipped to the current circle: a mistake, kept as a negative example",
        "fails: peak error above 5 counts"),
    preset<kDifference, kServoMove>(
        "book/8.2.2-backward-difference",
        "as book/8.2.2, speed by backward difference: a mistake, kept as a negative example",
        "fails: peak error above 5 counts, voltage touches its limit"),
    preset<kBothMistakes, kServoMove>("book/8.2.2-clipped-backward-difference",
                                      "as book/8.2.2 with both mistakes",
                                      "fails: peak error above 50 counts and growing"),
});

}  // namespace

std::span<const Preset> induction_servo_presets() noexcept {
  return kPresets;
}

}  // namespace drivebench::control
