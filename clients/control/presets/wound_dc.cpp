#include <array>
#include <string_view>
#include <vector>

#include "clients/control/moves/speed_ramp.hpp"
#include "clients/control/presets/dc_preset.hpp"
#include "clients/control/presets/presets_families.hpp"
#include "clients/control/wound_dc/shunt_dc_control.hpp"

namespace drivebench::control::wound_dc_presets {
namespace {

// The book has no numbers for these machines: machines, gains and moves are ours.

constexpr WoundDcModel kSeparate = {
    .armature_resistance_ohm = 3.0,
    .armature_inductance_h = 0.03,
    .motor_constant = 0.05,
    .field_resistance_ohm = 220.0,
    .field_flux_scale = 1.0,
    .field_shunt_resistance_ohm = 0.0,
    .inertia_kgm2 = 0.02,
    .friction_nms = 1e-3,
    .field = {
        .points =
            {{{0.0, 0.0}, {0.4, 12.0}, {0.6, 17.0}, {0.8, 20.5}, {1.0, 23.0}, {1.5, 26.0}, {2.0, 27.5}}},
        .count = 7}};
constexpr WoundDcModel kSeries = {.armature_resistance_ohm = 1.5,
                                  .armature_inductance_h = 0.01,
                                  .motor_constant = 1.2,
                                  .field_resistance_ohm = 1.0,
                                  .field_flux_scale = 1.0,
                                  .field_shunt_resistance_ohm = 0.0,
                                  .inertia_kgm2 = 0.02,
                                  .friction_nms = 1e-3,
                                  .field = FieldCurve::linear(0.12)};
/// The separate machine without saturation, with the friction of the load that turns with it.
constexpr WoundDcModel kShunt =
    with(kSeparate, &WoundDcModel::friction_nms, 0.05, &WoundDcModel::field, FieldCurve::linear(23.0));

constexpr WoundDcAxisParameters axis_of(const WoundDcModel& machine, double field_voltage_limit_v,
                                        double least_flux_wb, double observer_per_s) noexcept {
  return {.machine = machine,
          .sample_rate_hz = 10e3,
          .voltage_limit_v = 220.0,
          .current_limit_a = 20.0,
          .field_voltage_limit_v = field_voltage_limit_v,
          .least_flux_wb = least_flux_wb,
          .shaft = {
              .counts_per_revolution = 2000.0,
              .source = ShaftSpeed::kLoadObserver,
              .observer = ShaftObserverGains::placed(
                  std::array{observer_per_s, observer_per_s, observer_per_s}, machine.friction_rate_per_s()),
              .discretisation = Discretisation::kExact}};
}

constexpr double kRated_wb = 20.5;  // 0.8 A
constexpr SeparateDcParameters kArmatureAndField = {
    .axis = axis_of(kSeparate, 220.0, 2.0, 150.0),
    .flux = {.rated_flux_wb = kRated_wb, .base_speed_rad_s = 180.0},
    .flux_per_s = 20.0,
    .speed = ServoGains::placed(placed_polynomial<3>({30.0, 30.0, 30.0}))};

constexpr Polynomial<4> kEnergyPoles = placed_polynomial<4>({8.0, 8.0, 8.0, 8.0});
constexpr FieldControlDcParameters kFieldControl = {.axis = axis_of(kSeparate, 220.0, 2.0, 150.0),
                                                    .armature_voltage_v = 220.0,
                                                    .rated_flux_wb = kRated_wb,
                                                    .start_speed_rad_s = 205.0,
                                                    .energy_integral_per_s4 = kEnergyPoles[3],
                                                    .energy_proportional_per_s3 = kEnergyPoles[2],
                                                    .power_per_s2 = kEnergyPoles[1],
                                                    .power_slope_per_s = kEnergyPoles[0]};

constexpr SeriesDcParameters kSeriesSpeed = {
    .axis = axis_of(kSeries, 0.0, 0.02, 100.0),
    .least_current_a = 0.5,
    .speed = ServoGains::placed(placed_polynomial<3>({15.0, 15.0, 15.0}))};
constexpr SeriesDcParameters kSeriesSensorless =
    with(kSeriesSpeed, &SeriesDcParameters::source, SeriesDcSpeed::kCurrent, &SeriesDcParameters::observer,
         SeriesDcObserverGains::placed(std::array{80.0, 80.0, 80.0}, kSeries));
/// Without the load in the observer: the fan leaves ω̂ − ω = l1·τ_L/(J·p1·p2).
constexpr SeriesDcParameters kSeriesSpeedAlone =
    with(kSeriesSensorless, &SeriesDcParameters::observer,
         SeriesDcObserverGains::placed(std::array{80.0, 80.0}, kSeries));
constexpr WeakenedSeriesDcParameters kWeakened = {
    .axis = axis_of(with(kSeries, &WoundDcModel::field_shunt_resistance_ohm, 4.0), 0.0, 0.1, 100.0),
    .most_flux_wb = 0.9,
    .speed_proportional_per_s = 10.0,
    .speed_integral_per_s2 = 25.0};

constexpr ShuntDcParameters kShuntSpeed = {.axis = axis_of(kShunt, 0.0, 1.0, 100.0),
                                           .speed_proportional_per_s = 10.0,
                                           .speed_integral_per_s2 = 25.0};
constexpr ExactShuntDcParameters kShuntExact = {.axis = axis_of(kShunt, 0.0, 1.0, 100.0),
                                                .start_per_s = 10.0,
                                                .chain_proportional_per_s2 = 64.0,
                                                .chain_derivative_per_s = 16.0,
                                                .least_beta_rad_s3_per_v = 10.0};

constexpr SpeedRampParameters kTo300 = {.speed_rad_s = 300.0, .ramp_s = 2.0, .cruise_s = 1.0};
constexpr SpeedRampParameters kSlowlyTo300 = {.speed_rad_s = 300.0, .ramp_s = 4.0, .cruise_s = 2.0};
constexpr SpeedRampParameters kTo150 = {.speed_rad_s = 150.0, .ramp_s = 2.0, .cruise_s = 1.0};
constexpr SpeedRampParameters kTo100 = {.speed_rad_s = 100.0, .ramp_s = 2.0, .cruise_s = 2.0};
constexpr RunTiming kAtOnce = {.sample_rate_hz = 10e3, .prepare_s = 0.0, .hold_s = 0.0};
constexpr RunTiming kBuildUp = {.sample_rate_hz = 10e3, .prepare_s = 0.5, .hold_s = 0.0};

template <class ControllerType, class P>
Preset preset(const PresetText& text, std::string_view machine_kind, const P& p,
              const SpeedRampParameters& ramp, const RunTiming& timing) {
  return dc_preset<ControllerType, SpeedRamp>(text, machine_kind, Quantity::kVoltage, p, ramp, timing);
}

}  // namespace

std::vector<Preset> all() {
  return {
      preset<SeparateDcController>(
          {"book/2.40",
           "Chiasson 2005, problem 2.40: separately excited motor by armature and field, to 300 rad/s",
           "speed within 1 rad/s of the reference, beyond the base speed too", "dc-separate-servo"},
          "separately_excited_dc", kArmatureAndField, kTo300, kBuildUp),
      preset<FieldControlDcController>(
          {"book/2.41", "Chiasson 2005, problem 2.41: the same motor by its field alone above 205 rad/s",
           "300 rad/s at a constant 220 V", "dc-separate-servo"},
          "separately_excited_dc", kFieldControl, kSlowlyTo300, kBuildUp),
      preset<SeriesDcController>(
          {"book/2.42", "Chiasson 2005, problem 2.42: series motor with a fan to 150 rad/s",
           "speed within 2 rad/s of the reference", "dc-series-servo"},
          "series_dc", kSeriesSpeed, kTo150, kAtOnce),
      preset<WeakenedSeriesDcController>(
          {"book/2.43",
           "Chiasson 2005, problem 2.43: series motor with 4 ohm across its field, a fan, to 150 rad/s",
           "150 rad/s within 1 rad/s", "dc-series-weakened"},
          "series_dc", kWeakened, kTo150, kAtOnce),
      preset<SeriesDcController>({"book/2.44",
                                  "Chiasson 2005, problems 2.42 and 2.44: as book/2.42 without a sensor on "
                                  "the shaft, by an observer "
                                  "that knows of no load",
                                  "2.7 rad/s too slow: the fan is a load to the observer", "dc-series-servo"},
                                 "series_dc", kSeriesSpeedAlone, kTo150, kAtOnce),
      preset<SeriesDcController>(
          {"book/2.45", "Chiasson 2005, problems 2.42 and 2.45: as book/2.44 with the load in the observer",
           "speed within 3 rad/s of the reference", "dc-series-servo"},
          "series_dc", kSeriesSensorless, kTo150, kAtOnce),
      preset<ExactShuntDcController>(
          {"book/2.46",
           "Chiasson 2005, problem 2.46: shunt motor, exact linearisation, to 100 rad/s under load",
           "100 rad/s within 1 rad/s", "dc-shunt-servo"},
          "shunt_dc", kShuntExact, kTo100, kAtOnce),
      preset<ShuntDcController>(
          {"book/2.47",
           "Chiasson 2005, problem 2.47: shunt motor, input-output linearisation, to 100 rad/s under load",
           "100 rad/s within 1 rad/s; no bounded flux above 191 rad/s", "dc-shunt-servo"},
          "shunt_dc", kShuntSpeed, kTo100, kAtOnce),
  };
}

}  // namespace drivebench::control::wound_dc_presets
