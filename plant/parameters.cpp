#include "plant/parameters.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <string>

namespace drivebench {
namespace {

/// Accessors for section.member; integers and switches are seen as doubles.
template <auto Section, auto Member>
constexpr double (*get_member)(const AxisParameters&) noexcept =
    [](const AxisParameters& p) noexcept { return static_cast<double>(p.*Section.*Member); };

template <auto Section, auto Member>
constexpr void (*set_member)(AxisParameters&, double) noexcept =
    [](AxisParameters& p, double value) noexcept {
      auto& member = p.*Section.*Member;
      member = static_cast<std::remove_reference_t<decltype(member)>>(value);
    };

enum Trait : unsigned { kReal = 0, kInteger = 1, kLive = 2, kRequired = 4 };

template <auto Section, auto Member>
constexpr Parameter row(std::string_view name, std::string_view unit, double minimum, double maximum,
                        unsigned traits, std::string_view meaning) {
  return {name,
          unit,
          minimum,
          maximum,
          (traits & kInteger) != 0,
          (traits & kLive) != 0,
          (traits & kRequired) != 0,
          meaning,
          get_member<Section, Member>,
          set_member<Section, Member>};
}

using Machine = InductionMachineParameters;
using Shaft = ShaftParameters;
using Amplifier = AmplifierParameters;
using EncoderP = EncoderParameters;
using Sensor = CurrentSensorParameters;
constexpr auto kMachine = &AxisParameters::machine;
constexpr auto kShaft = &AxisParameters::mechanics;
constexpr auto kAmplifier = &AxisParameters::amplifier;
constexpr auto kEncoder = &AxisParameters::encoder;
constexpr auto kSensor = &AxisParameters::current_sensor;

constexpr auto kTable = std::to_array<Parameter>({
    row<kMachine, &Machine::pole_pairs>("machine.pole_pairs", "1", 1, 1000, kInteger | kRequired, "n_p"),
    row<kMachine, &Machine::stator_resistance_ohm>("machine.stator_resistance_ohm", "ohm", 1e-6, 1e6,
                                                   kLive | kRequired, "R_S, two-phase equivalent"),
    row<kMachine, &Machine::rotor_resistance_ohm>("machine.rotor_resistance_ohm", "ohm", 1e-6, 1e6,
                                                  kLive | kRequired, "R_R, two-phase equivalent"),
    row<kMachine, &Machine::stator_inductance_h>("machine.stator_inductance_h", "H", 1e-9, 1e3, kRequired,
                                                 "L_S"),
    row<kMachine, &Machine::rotor_inductance_h>("machine.rotor_inductance_h", "H", 1e-9, 1e3, kRequired,
                                                "L_R"),
    row<kMachine, &Machine::mutual_inductance_h>("machine.mutual_inductance_h", "H", 1e-9, 1e3, kRequired,
                                                 "M"),

    row<kShaft, &Shaft::inertia_kgm2>("mechanics.inertia_kgm2", "kg*m^2", 1e-12, 1e9, kLive | kRequired,
                                      "J of the rotor and all that turns with it"),
    row<kShaft, &Shaft::viscous_friction_nms>("mechanics.viscous_friction_nms", "N*m*s/rad", 0, 1e6, kLive,
                                              "f, friction torque over speed"),
    row<kShaft, &Shaft::coulomb_friction_nm>("mechanics.coulomb_friction_nm", "N*m", 0, 1e6, kLive,
                                             "friction torque that opposes motion"),
    row<kShaft, &Shaft::static_friction_nm>(
        "mechanics.static_friction_nm", "N*m", 0, 1e6, kLive,
        "torque that holds a standing shaft; at least the Coulomb friction"),

    row<kAmplifier, &Amplifier::voltage_limit_v>("amplifier.voltage_limit_v", "V", 1e-3, 1e6,
                                                 kLive | kRequired,
                                                 "largest phase voltage, both signs; DC link voltage"),
    row<kAmplifier, &Amplifier::gain>("amplifier.gain", "1", 0, 100, kLive, "output over command"),
    row<kAmplifier, &Amplifier::offset_a_v>("amplifier.offset_a_v", "V", -1e6, 1e6, kLive,
                                            "output offset of phase a"),
    row<kAmplifier, &Amplifier::offset_b_v>("amplifier.offset_b_v", "V", -1e6, 1e6, kLive,
                                            "output offset of phase b"),
    row<kAmplifier, &Amplifier::over_current_a>("amplifier.over_current_a", "A", 1e-6, 1e6, kLive | kRequired,
                                                "a phase current above this raises over_current"),
    row<kAmplifier, &Amplifier::over_current_trip>("amplifier.over_current_trip", "1", 0, 1, kInteger | kLive,
                                                   "1: over-current switches the gates off until cleared"),

    row<kEncoder, &EncoderP::counts_per_revolution>("encoder.counts_per_revolution", "counts", 4, 100000000,
                                                    kInteger | kRequired,
                                                    "N after quadrature, a multiple of 4"),
    row<kEncoder, &EncoderP::half_count_offset>(
        "encoder.half_count_offset", "1", 0, 1,
        kInteger, "1: count = floor(theta N/(2 pi) + 1/2), error centred on zero"),

    row<kSensor, &Sensor::bits>("current_sensor.bits", "bit", 0, 24, kInteger,
                                "converter resolution; 0: ideal"),
    row<kSensor, &Sensor::full_scale_a>("current_sensor.full_scale_a", "A", 1e-6, 1e6, kReal,
                                        "range -full_scale .. +full_scale"),
    row<kSensor, &Sensor::gain_a>("current_sensor.gain_a", "1", -100, 100, kLive, "gain of phase a"),
    row<kSensor, &Sensor::gain_b>("current_sensor.gain_b", "1", -100, 100, kLive, "gain of phase b"),
    row<kSensor, &Sensor::offset_a_a>("current_sensor.offset_a_a", "A", -1e6, 1e6, kLive,
                                      "offset of phase a"),
    row<kSensor, &Sensor::offset_b_a>("current_sensor.offset_b_a", "A", -1e6, 1e6, kLive,
                                      "offset of phase b"),
    row<kSensor, &Sensor::noise_rms_a>("current_sensor.noise_rms_a", "A", 0, 1e6, kLive,
                                       "Gaussian, both phases"),
});

std::string text(double value) {
  std::array<char, 32> buffer{};
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value).ptr;
  return {buffer.data(), end};
}

}  // namespace

std::span<const Parameter> axis_parameters() noexcept {
  return kTable;
}

const Parameter* find_parameter(std::string_view name) noexcept {
  for (const Parameter& row : kTable) {
    if (row.name == name) return &row;
  }
  return nullptr;
}

std::string problem_with(const Parameter& parameter, double value) {
  if (!(value >= parameter.minimum && value <= parameter.maximum)) {
    return "is " + text(value) + " but must lie between " + text(parameter.minimum) + " and " +
           text(parameter.maximum) + (parameter.unit == "1" ? "" : " " + std::string(parameter.unit));
  }
  if (parameter.integer && value != std::trunc(value))
    return "is " + text(value) + " but must be a whole number";
  return {};
}

std::vector<Problem> problems(const AxisParameters& p) {
  std::vector<Problem> found;
  for (const Parameter& row : kTable) {
    if (std::string rule = problem_with(row, row.get(p)); !rule.empty()) {
      found.push_back({std::string(row.name), std::move(rule)});
    }
  }
  const bool has_inductances = p.machine.rotor_inductance_h > 0.0 && p.machine.stator_inductance_h > 0.0;
  if (const double sigma = has_inductances ? leakage_factor(p.machine) : 1.0; !(sigma > 0.0)) {
    found.push_back({"machine.mutual_inductance_h", "makes the leakage factor sigma = 1 - M^2/(L_R L_S) = " +
                                                        text(sigma) + " but it must be above 0"});
  }
  if (p.mechanics.static_friction_nm < p.mechanics.coulomb_friction_nm) {
    found.push_back({"mechanics.static_friction_nm", "is " + text(p.mechanics.static_friction_nm) +
                                                         " but must not be below coulomb_friction_nm = " +
                                                         text(p.mechanics.coulomb_friction_nm)});
  }
  if (p.encoder.counts_per_revolution % 4 != 0) {
    found.push_back(
        {"encoder.counts_per_revolution",
         "is " + std::to_string(p.encoder.counts_per_revolution) + " but must be a multiple of 4"});
  }
  return found;
}

}  // namespace drivebench
