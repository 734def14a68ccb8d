#include "plant/parameters/sensor_rows.hpp"

#include <array>
#include <string>

#include "plant/parameters/rows.hpp"

namespace drivebench {
namespace {

using Current = CurrentSensorParameters;
using Analog = AnalogParameters;
using Tachometer = TachometerParameters;
using Resolver = ResolverParameters;
using Hall = HallParameters;
using Meter = MeterParameters;
using Thermal = ThermalParameters;

template <auto Member>
constexpr Parameter encoder_row(std::string_view name, std::string_view unit, double minimum, double maximum,
                                unsigned traits, std::string_view meaning, Range usual = {}) {
  return row<&AxisParameters::encoder, Member>(name, unit, minimum, maximum, traits, meaning, usual);
}

template <auto... Path>
constexpr Parameter sensor_row(std::string_view name, std::string_view unit, double minimum, double maximum,
                               unsigned traits, std::string_view meaning) {
  return row<&AxisParameters::sensors, Path...>(name, unit, minimum, maximum, traits, meaning);
}

template <auto Member>
constexpr Parameter thermal_row(std::string_view name, std::string_view unit, double minimum, double maximum,
                                unsigned traits, std::string_view meaning) {
  return row<&AxisParameters::thermal, Member>(name, unit, minimum, maximum, traits, meaning);
}

constexpr std::string_view kDelayMeaning = "age of the sample: 0, 0.5 or whole";
constexpr std::string_view kFilterMeaning = "corner of a first-order filter; 0: none";

constexpr auto kEncoder = std::to_array<Parameter>({
    encoder_row<&EncoderParameters::counts_per_revolution>("encoder.counts_per_revolution", "counts", 4,
                                                           100000000, kInteger | kRequired,
                                                           "N after quadrature, a multiple of 4", {4, 1e8}),
    encoder_row<&EncoderParameters::half_count_offset>(
        "encoder.half_count_offset", "1", 0, 1, kInteger,
        "1: count = floor(theta N/(2 pi) + 1/2), error centred on zero"),
    encoder_row<&EncoderParameters::swapped>(
        "encoder.swapped", "1", 0, 1, kInteger,
        "1: A and B are exchanged, the count falls when the angle rises"),
});

constexpr auto kCurrentSensor = std::to_array<Parameter>({
    sensor_row<&SensorParameters::current, &Current::bits>("current_sensor.bits", "bit", 0, 24, kInteger,
                                                           "of the converter; 0: ideal"),
    sensor_row<&SensorParameters::current, &Current::full_scale_a>("current_sensor.full_scale_a", "A", 1e-6,
                                                                   1e6, kReal, "plus and minus this"),
    sensor_row<&SensorParameters::current, &Current::gain_a>("current_sensor.gain_a", "1", -100, 100, kLive,
                                                             "gain of phase a"),
    sensor_row<&SensorParameters::current, &Current::gain_b>("current_sensor.gain_b", "1", -100, 100, kLive,
                                                             "gain of phase b"),
    sensor_row<&SensorParameters::current, &Current::gain_c>("current_sensor.gain_c", "1", -100, 100, kLive,
                                                             "gain of phase c"),
    sensor_row<&SensorParameters::current, &Current::offset_a_a>("current_sensor.offset_a_a", "A", -1e6, 1e6,
                                                                 kLive, "offset of phase a"),
    sensor_row<&SensorParameters::current, &Current::offset_b_a>("current_sensor.offset_b_a", "A", -1e6, 1e6,
                                                                 kLive, "offset of phase b"),
    sensor_row<&SensorParameters::current, &Current::offset_c_a>("current_sensor.offset_c_a", "A", -1e6, 1e6,
                                                                 kLive, "offset of phase c"),
    sensor_row<&SensorParameters::current, &Current::noise_rms_a>("current_sensor.noise_rms_a", "A", 0, 1e6,
                                                                  kLive, "Gaussian, in each phase its own"),
    sensor_row<&SensorParameters::current, &Current::delay_ticks>("current_sensor.delay_ticks", "ticks", 0,
                                                                  kMaxSensorDelayTicks, kReal, kDelayMeaning),
    sensor_row<&SensorParameters::current, &Current::filter_hz>("current_sensor.filter_hz", "Hz", 0, 1e6,
                                                                kReal, kFilterMeaning),
});

/// The names of a section that is an analog channel.
struct AnalogNames {
  std::string_view enabled;
  std::string_view bits;
  std::string_view full_scale;
  std::string_view gain;
  std::string_view offset;
  std::string_view noise_rms;
  std::string_view delay_ticks;
  std::string_view filter_hz;
};

template <auto... Path>
constexpr std::array<Parameter, 8> analog_rows(const AnalogNames& name, std::string_view unit,
                                               std::string_view enabled_meaning) {
  return {
      sensor_row<Path..., &Analog::enabled>(name.enabled, "1", 0, 1, kInteger, enabled_meaning),
      sensor_row<Path..., &Analog::bits>(name.bits, "bit", 0, 24, kInteger, "of the converter; 0: ideal"),
      sensor_row<Path..., &Analog::full_scale>(name.full_scale, unit, 1e-6, 1e6, kReal,
                                               "plus and minus this"),
      sensor_row<Path..., &Analog::gain>(name.gain, "1", -100, 100, kLive, "reading over true value"),
      sensor_row<Path..., &Analog::offset>(name.offset, unit, -1e6, 1e6, kLive, "added to the reading"),
      sensor_row<Path..., &Analog::noise_rms>(name.noise_rms, unit, 0, 1e6, kLive, "Gaussian"),
      sensor_row<Path..., &Analog::delay_ticks>(name.delay_ticks, "ticks", 0, kMaxSensorDelayTicks, kReal,
                                                kDelayMeaning),
      sensor_row<Path..., &Analog::filter_hz>(name.filter_hz, "Hz", 0, 1e6, kReal, kFilterMeaning),
  };
}

constexpr auto kVoltageSensor = analog_rows<&SensorParameters::voltage>(
    {.enabled = "voltage_sensor.enabled",
     .bits = "voltage_sensor.bits",
     .full_scale = "voltage_sensor.full_scale_v",
     .gain = "voltage_sensor.gain",
     .offset = "voltage_sensor.offset_v",
     .noise_rms = "voltage_sensor.noise_rms_v",
     .delay_ticks = "voltage_sensor.delay_ticks",
     .filter_hz = "voltage_sensor.filter_hz"},
    "V", "1: terminal voltages are measured; 0: the true ones are shown");

constexpr auto kNeutralSensor = analog_rows<&SensorParameters::neutral>(
    {.enabled = "neutral_sensor.enabled",
     .bits = "neutral_sensor.bits",
     .full_scale = "neutral_sensor.full_scale_v",
     .gain = "neutral_sensor.gain",
     .offset = "neutral_sensor.offset_v",
     .noise_rms = "neutral_sensor.noise_rms_v",
     .delay_ticks = "neutral_sensor.delay_ticks",
     .filter_hz = "neutral_sensor.filter_hz"},
    "V", "1: the motor neutral is measured against the middle of the DC link");

constexpr auto kBusSensor =
    analog_rows<&SensorParameters::bus>({.enabled = "bus_sensor.enabled",
                                         .bits = "bus_sensor.bits",
                                         .full_scale = "bus_sensor.full_scale_v",
                                         .gain = "bus_sensor.gain",
                                         .offset = "bus_sensor.offset_v",
                                         .noise_rms = "bus_sensor.noise_rms_v",
                                         .delay_ticks = "bus_sensor.delay_ticks",
                                         .filter_hz = "bus_sensor.filter_hz"},
                                        "V", "1: the DC link is measured; 0: its true voltage is shown");

constexpr auto kTemperatureSensor =
    analog_rows<&SensorParameters::temperature>({.enabled = "temperature_sensor.enabled",
                                                 .bits = "temperature_sensor.bits",
                                                 .full_scale = "temperature_sensor.full_scale_k",
                                                 .gain = "temperature_sensor.gain",
                                                 .offset = "temperature_sensor.offset_k",
                                                 .noise_rms = "temperature_sensor.noise_rms_k",
                                                 .delay_ticks = "temperature_sensor.delay_ticks",
                                                 .filter_hz = "temperature_sensor.filter_hz"},
                                                "K", "1: the winding's temperature is measured");

constexpr auto kTachometerChannel = analog_rows<&SensorParameters::tachometer, &Tachometer::analog>(
    {.enabled = "tachometer.enabled",
     .bits = "tachometer.bits",
     .full_scale = "tachometer.full_scale_v",
     .gain = "tachometer.gain",
     .offset = "tachometer.offset_v",
     .noise_rms = "tachometer.noise_rms_v",
     .delay_ticks = "tachometer.delay_ticks",
     .filter_hz = "tachometer.filter_hz"},
    "V", "1: a DC tachometer sits on the rotor");

constexpr auto kTachometer = std::to_array<Parameter>({
    sensor_row<&SensorParameters::tachometer, &Tachometer::gain_vs_per_rad>(
        "tachometer.gain_vs_per_rad", "V*s/rad", -1e6, 1e6, kLive, "voltage over speed"),
    sensor_row<&SensorParameters::tachometer, &Tachometer::ripple>(
        "tachometer.ripple", "1", 0, 1, kLive, "of its commutator: amplitude over mean voltage"),
    sensor_row<&SensorParameters::tachometer, &Tachometer::ripple_per_turn>(
        "tachometer.ripple_per_turn", "1", 0, 1000, kInteger, "periods of the ripple in a turn"),
});

constexpr auto kResolverChannel = analog_rows<&SensorParameters::resolver, &Resolver::analog>(
    {.enabled = "resolver.enabled",
     .bits = "resolver.bits",
     .full_scale = "resolver.full_scale_v",
     .gain = "resolver.gain",
     .offset = "resolver.offset_v",
     .noise_rms = "resolver.noise_rms_v",
     .delay_ticks = "resolver.delay_ticks",
     .filter_hz = "resolver.filter_hz"},
    "V", "1: a resolver sits on the rotor, seen demodulated");

constexpr auto kResolver = std::to_array<Parameter>({
    sensor_row<&SensorParameters::resolver, &Resolver::pole_pairs>(
        "resolver.pole_pairs", "1", 1, 1000, kInteger, "periods of sine and cosine in a turn"),
    sensor_row<&SensorParameters::resolver, &Resolver::amplitude_v>("resolver.amplitude_v", "V", 1e-6, 1e6,
                                                                    kLive, "of sine and cosine"),
    sensor_row<&SensorParameters::resolver, &Resolver::sine_gain>("resolver.sine_gain", "1", -100, 100, kLive,
                                                                  "amplitude of the sine over amplitude_v"),
    sensor_row<&SensorParameters::resolver, &Resolver::cosine_gain>(
        "resolver.cosine_gain", "1", -100, 100, kLive, "amplitude of the cosine over amplitude_v"),
    sensor_row<&SensorParameters::resolver, &Resolver::sine_offset_v>("resolver.sine_offset_v", "V", -1e6,
                                                                      1e6, kLive, "added to the sine"),
    sensor_row<&SensorParameters::resolver, &Resolver::cosine_offset_v>("resolver.cosine_offset_v", "V", -1e6,
                                                                        1e6, kLive, "added to the cosine"),
});

constexpr auto kOthers = std::to_array<Parameter>({
    sensor_row<&SensorParameters::hall, &Hall::enabled>("hall.enabled", "1", 0, 1, kInteger,
                                                        "1: three Hall sensors sit on the stator"),
    sensor_row<&SensorParameters::hall, &Hall::offset_rad>(
        "hall.offset_rad", "rad", -3.15, 3.15, kLive,
        "electrical angle by which they are displaced; 0: edges at 30, 90, ... 330 degrees"),
    sensor_row<&SensorParameters::meter, &Meter::enabled>("meter.enabled", "1", 0, 1, kInteger,
                                                          "1: a power analyser is at the stator terminals"),
    sensor_row<&SensorParameters::meter, &Meter::window_s>(
        "meter.window_s", "s", 1e-6, 3600, kReal,
        "time over which it averages, rounded to ticks; whole periods of the voltage"),
    thermal_row<&Thermal::enabled>("thermal.enabled", "1", 0, 1, kInteger,
                                   "1: losses heat the winding, heat raises resistances"),
    thermal_row<&Thermal::resistance_k_per_w>("thermal.resistance_k_per_w", "K/W", 0, 1e6, kLive,
                                              "rise of temperature over losses, settled"),
    thermal_row<&Thermal::time_constant_s>("thermal.time_constant_s", "s", 1e-3, 1e9, kLive,
                                           "of heating and cooling"),
    thermal_row<&Thermal::ambient_k>("thermal.ambient_k", "K", 1, 1000, kLive,
                                     "temperature of the surroundings, and of the winding at tick 0"),
    thermal_row<&Thermal::reference_k>("thermal.reference_k", "K", 1, 1000, kReal,
                                       "temperature at which the resistances of the machine hold"),
    thermal_row<&Thermal::stator_coefficient_per_k>("thermal.stator_coefficient_per_k", "1/K", 0, 0.1, kLive,
                                                    "growth of the stator resistance; copper 0.00393"),
    thermal_row<&Thermal::rotor_coefficient_per_k>(
        "thermal.rotor_coefficient_per_k", "1/K", 0, 0.1, kLive,
        "growth of the resistance of cage or field winding; aluminium 0.00403"),
});

template <std::size_t... Sizes>
constexpr auto joined(const std::array<Parameter, Sizes>&... tables) {
  std::array<Parameter, (Sizes + ...)> all{};
  std::size_t next = 0;
  const auto append = [&](const auto& table) {
    for (const Parameter& parameter : table)
      all[next++] = parameter;
  };
  (append(tables), ...);
  return all;
}

constexpr auto kSensorTable =
    joined(kEncoder, kCurrentSensor, kVoltageSensor, kNeutralSensor, kBusSensor, kTemperatureSensor,
           kTachometerChannel, kTachometer, kResolverChannel, kResolver, kOthers);

void add_delay_problem(std::string_view field, double ticks, Problems& found) {
  if (is_sensor_delay(ticks)) return;
  found.add(field, [&] {
    return "is " + text(ticks) + " but must be 0, 0.5 or a whole number of ticks up to " +
           text(kMaxSensorDelayTicks);
  });
}

}  // namespace

std::span<const Parameter> sensor_rows() noexcept {
  return kSensorTable;
}

void add_problems(const EncoderParameters& p, Problems& found) {
  if (p.counts_per_revolution % 4 == 0) return;
  found.add("encoder.counts_per_revolution",
            [&] { return "is " + std::to_string(p.counts_per_revolution) + " but must be a multiple of 4"; });
}

void add_problems(const SensorParameters& p, Problems& found) {
  add_delay_problem("current_sensor.delay_ticks", p.current.delay_ticks, found);
  add_delay_problem("voltage_sensor.delay_ticks", p.voltage.delay_ticks, found);
  add_delay_problem("neutral_sensor.delay_ticks", p.neutral.delay_ticks, found);
  add_delay_problem("bus_sensor.delay_ticks", p.bus.delay_ticks, found);
  add_delay_problem("temperature_sensor.delay_ticks", p.temperature.delay_ticks, found);
  add_delay_problem("tachometer.delay_ticks", p.tachometer.analog.delay_ticks, found);
  add_delay_problem("resolver.delay_ticks", p.resolver.analog.delay_ticks, found);
  if (p.tachometer.analog.enabled && p.tachometer.gain_vs_per_rad == 0.0) {
    found.add("tachometer.gain_vs_per_rad",
              "is 0 but must not be while tachometer.enabled is 1: it would read nothing");
  }
  if (p.tachometer.ripple > 0.0 && p.tachometer.ripple_per_turn == 0) {
    found.add("tachometer.ripple_per_turn", [&] {
      return "is 0 but must be above it with tachometer.ripple = " + text(p.tachometer.ripple);
    });
  }
}

void add_problems(const ThermalParameters& p, Problems& found) {
  if (!p.enabled) return;
  const auto check = [&](const char* field, double coefficient_per_k) {
    const double factor = 1.0 + coefficient_per_k * (p.ambient_k - p.reference_k);
    if (factor > 0.0) return;
    found.add(field, [&] {
      return "is " + text(coefficient_per_k) + " 1/K and makes the resistance at ambient_k " + text(factor) +
             " times that at reference_k, but it must stay above 0";
    });
  };
  check("thermal.stator_coefficient_per_k", p.stator_coefficient_per_k);
  check("thermal.rotor_coefficient_per_k", p.rotor_coefficient_per_k);
}

}  // namespace drivebench
