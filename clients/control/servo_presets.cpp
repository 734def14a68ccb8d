#include "clients/control/servo_presets.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <numbers>
#include <vector>

namespace drivebench::control {
namespace {

/// The book's 1/12 hp two-phase servo motor (8.2.2), 2000 counts, amplifiers of ±80 V and ±6 A, 8 kHz.
/// The 8 A for i_q,ref are ours: the current loop passes on only 0.59 of a quick reference, so a clip at 6 A
/// spoils the tracking long before 6 A flow.
constexpr ControllerParameters kServoController = {
    .machine = {.pole_pairs = 3.0,
                .mutual_inductance_h = 0.0117,
                .rotor_resistance_ohm = 3.9,
                .rotor_inductance_h = 0.014,
                .friction_nms = 1.4e-4,
                .inertia_kgm2 = 1.1e-4},
    .sample_rate_hz = 8000.0,
    .counts_per_revolution = 2000,
    .voltage_limit_v = 80.0,
    .current_limit_a = 6.0,
    .rated_direct_current_a = 5.5 / std::numbers::sqrt2,
    .quadrature_reference_limit_a = 8.0,
    .current = {.proportional_v_per_a = 6.4, .integral_v_per_as = 740.0},
    .position = {.integral_per_s3 = 1.07e6, .proportional_per_s2 = 7.04e5, .derivative_per_s = 1.07e3},
    .flux = {.proportional_a_per_wb = 1600.0, .integral_a_per_wbs = 23000.0},
    .speed_observer = {.angle_per_s = 1.8e3, .speed_per_s2 = 8e5}};

/// The book gives the length of the move (180° in 73 ms) and its top speed (below 75 rad/s) but not the
/// profile.
constexpr MoveParameters kMoveA = {.trajectory = {.distance_rad = std::numbers::pi,
                                                  .ramp_up_s = 0.030,
                                                  .cruise_s = 0.013,
                                                  .ramp_down_s = 0.030},
                                   .flux_build_up_s = 0.025,
                                   .hold_s = 0.030};

/// ω_max = 75 rad/s: π/75 = 41.888 ms is t2.
constexpr MoveParameters kMoveB = {.trajectory = {.distance_rad = std::numbers::pi,
                                                  .ramp_up_s = 0.025,
                                                  .cruise_s = std::numbers::pi / 75.0 - 0.025,
                                                  .ramp_down_s = 0.025},
                                   .flux_build_up_s = 0.025,
                                   .hold_s = 0.030};

constexpr ControllerParameters at_rate(ControllerParameters p, double sample_rate_hz) noexcept {
  p.sample_rate_hz = sample_rate_hz;
  return p;
}

constexpr ControllerParameters with(ControllerParameters p, SpeedSource source,
                                    QuadratureClip clip) noexcept {
  p.speed_source = source;
  p.quadrature_clip = clip;
  return p;
}

constexpr auto kPresets = std::to_array<ServoPreset>({
    {.name = "book/8.2.2",
     .source = "Chiasson 2005, 8.2.2: field-oriented 180 degree move; profile A (30, 13, 30 ms)",
     .expectation = "peak error at most 2 counts, final 0 to 1",
     .controller = kServoController,
     .move = kMoveA},
    {.name = "book/8.2.2-profile-b",
     .source = "as book/8.2.2 with the profile of exercise 15: 75 rad/s, ramps of 25 ms",
     .expectation = "peak error about 2 counts, peak phase current above 6 A",
     .controller = kServoController,
     .move = kMoveB},
    {.name = "book/8.2.2-4khz",
     .source = "as book/8.2.2 at half the sample rate, same gains",
     .expectation = "peak error at most 2 counts",
     .controller = at_rate(kServoController, 4000.0),
     .move = kMoveA},
    {.name = "book/8.2.2-clipped",
     .source =
         "as book/8.2.2, i_q reference clipped to the current circle: a mistake, kept as a negative example",
     .expectation = "fails: peak error above 5 counts",
     .controller = with(kServoController, SpeedSource::kObserver, QuadratureClip::kCircular),
     .move = kMoveA},
    {.name = "book/8.2.2-backward-difference",
     .source = "as book/8.2.2, speed by backward difference: a mistake, kept as a negative example",
     .expectation = "fails: peak error above 5 counts, voltage touches its limit",
     .controller = with(kServoController, SpeedSource::kBackwardDifference, QuadratureClip::kFixed),
     .move = kMoveA},
    {.name = "book/8.2.2-clipped-backward-difference",
     .source = "as book/8.2.2 with both mistakes",
     .expectation = "fails: peak error above 50 counts and growing",
     .controller = with(kServoController, SpeedSource::kBackwardDifference, QuadratureClip::kCircular),
     .move = kMoveA},
});

/// Levenshtein: the fewest letters to insert, drop or change.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j)
    row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t changed = diagonal + (a[i - 1] == b[j - 1] ? 0U : 1U);
      diagonal = row[j];
      row[j] = std::min({changed, row[j] + 1, row[j - 1] + 1});
    }
  }
  return row.back();
}

template <typename... Numbers>
void append(std::string& text, const char* format, Numbers... numbers) {
  std::array<char, 256> line{};
  std::snprintf(line.data(), line.size(), format, numbers...);
  text += line.data();
}

}  // namespace

std::span<const ServoPreset> servo_presets() noexcept {
  return kPresets;
}

const ServoPreset* find_servo_preset(std::string_view name) noexcept {
  const auto found =
      std::find_if(kPresets.begin(), kPresets.end(), [name](const ServoPreset& p) { return p.name == name; });
  return found == kPresets.end() ? nullptr : &*found;
}

std::string_view nearest_servo_preset_name(std::string_view name) {
  std::string_view nearest = kPresets.front().name;
  for (const ServoPreset& p : kPresets) {
    if (edit_distance(name, p.name) < edit_distance(name, nearest)) nearest = p.name;
  }
  return nearest;
}

std::string servo_presets_table() {
  std::string text;
  for (const ServoPreset& p : kPresets) {
    const ControllerParameters& c = p.controller;
    const TrajectoryParameters& t = p.move.trajectory;
    text.append(p.name)
        .append("\n  source    ")
        .append(p.source)
        .append("\n  expect    ")
        .append(p.expectation);
    append(text, "\n  move      %.4g deg in %.4g ms, at most %.4g rad/s, after %.4g ms of flux build-up\n",
           t.distance_rad * 180.0 / std::numbers::pi, t.duration_s() * 1e3, t.max_speed_rad_s(),
           p.move.flux_build_up_s * 1e3);
    append(text, "  sampling  %.4g kHz, %g counts/rev, limits %.4g V and %.4g A per phase, i_q,ref %s\n",
           c.sample_rate_hz / 1e3, c.counts_per_revolution, c.voltage_limit_v, c.current_limit_a,
           c.quadrature_clip == QuadratureClip::kFixed ? "fixed" : "on the current circle");
    append(text, "  currents  K_P %.4g V/A, K_I %.4g V/(A s), i_d0 %.4g A (%.4g Wb)\n",
           c.current.proportional_v_per_a, c.current.integral_v_per_as, c.rated_direct_current_a,
           c.rated_flux_wb());
    append(text, "  position  K_0 %.4g 1/s^3, K_1 %.4g 1/s^2, K_2 %.4g 1/s\n", c.position.integral_per_s3,
           c.position.proportional_per_s2, c.position.derivative_per_s);
    append(text, "  flux      K_P %.4g A/Wb, K_I %.4g A/(Wb s)\n", c.flux.proportional_a_per_wb,
           c.flux.integral_a_per_wbs);
    append(text, "  speed     %s, l_1 %.4g 1/s, l_2 %.4g 1/s^2\n",
           c.speed_source == SpeedSource::kObserver ? "observer" : "backward difference (observer beside it)",
           c.speed_observer.angle_per_s, c.speed_observer.speed_per_s2);
  }
  return text;
}

}  // namespace drivebench::control
