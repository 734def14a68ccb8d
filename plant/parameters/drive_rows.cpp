#include "plant/parameters/drive_rows.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "plant/parameters/rows.hpp"
#include "plant/parameters/transformer_rows.hpp"

namespace drivebench {
namespace {

using Amplifier = AmplifierParameters;
using Loop = CurrentLoopParameters;
using Inverter = InverterParameters;
using Bus = BusParameters;
using Source = SourceParameters;

template <auto Member>
constexpr auto amplifier = row<&AxisParameters::drive, &DriveParameters::amplifier, Member>;
template <auto Member>
constexpr auto loop = row<&AxisParameters::drive, &DriveParameters::current_loop, Member>;
template <auto Member>
constexpr auto inverter = row<&AxisParameters::drive, &DriveParameters::inverter, Member>;
template <auto Member>
constexpr auto bus = row<&AxisParameters::drive, &DriveParameters::bus, Member>;
template <auto Member>
constexpr auto source = row<&AxisParameters::drive, &DriveParameters::source, Member>;

constexpr auto kDriveKinds = std::to_array<std::string_view>(
    {"voltage_amplifier", "current_amplifier", "averaged_inverter", "switched_inverter", "source"});
constexpr auto kWaveforms = std::to_array<std::string_view>({"sine", "trapezoid", "table"});

constexpr auto kDriveTable = std::to_array<Parameter>({
    choice(row<&AxisParameters::drive, &DriveParameters::kind>(
               "drive.kind", "1", 0, 0, kInteger,
               "what stands between command and terminals; a source takes no commands"),
           kDriveKinds),

    amplifier<&Amplifier::voltage_limit_v>("amplifier.voltage_limit_v", "V", 1e-3, 1e6, kLive | kRequired,
                                           "largest phase voltage, both signs; DC link voltage", {0.1, 1e5}),
    amplifier<&Amplifier::gain>("amplifier.gain", "1", 0, 100, kLive, "output over command"),
    amplifier<&Amplifier::offset_a_v>("amplifier.offset_a_v", "V", -1e6, 1e6, kLive,
                                      "output offset of phase a"),
    amplifier<&Amplifier::offset_b_v>("amplifier.offset_b_v", "V", -1e6, 1e6, kLive,
                                      "output offset of phase b"),
    amplifier<&Amplifier::offset_c_v>("amplifier.offset_c_v", "V", -1e6, 1e6, kLive,
                                      "output offset of phase c"),
    amplifier<&Amplifier::delay_ticks>("amplifier.delay_ticks", "ticks", 0, kMaxDelayTicks, kLive,
                                       "transport delay from command to output, in parts of a tick as well"),
    amplifier<&Amplifier::filter_hz>("amplifier.filter_hz", "Hz", 0, 1e7, kLive,
                                     "corner of the first-order output filter; 0: none"),
    amplifier<&Amplifier::over_current_a>("amplifier.over_current_a", "A", 1e-6, 1e6, kLive | kRequired,
                                          "a phase current above this raises over_current", {1e-3, 1e5}),
    amplifier<&Amplifier::over_current_trip>("amplifier.over_current_trip", "1", 0, 1, kInteger | kLive,
                                             "1: over-current switches the gates off until cleared"),

    loop<&Loop::proportional_v_per_a>("current_loop.proportional_v_per_a", "V/A", 0, 1e9, kLive,
                                      "K_P of the current amplifier; below inductance over substep"),
    loop<&Loop::integral_v_per_as>("current_loop.integral_v_per_as", "V/(A*s)", 0, 1e12, kLive,
                                   "K_I of the current amplifier; 0: proportional only"),
    loop<&Loop::limit_a>("current_loop.limit_a", "A", 0, 1e6, kLive,
                         "largest commanded phase current, both signs"),

    inverter<&Inverter::pwm_periods_per_tick>("inverter.pwm_periods_per_tick", "1", 1, 64, kInteger,
                                              "carrier periods in a sample period"),
    inverter<&Inverter::dead_time_s>("inverter.dead_time_s", "s", 0, 1e-2, kLive,
                                     "both switches of a leg are open so long at each commutation"),
    inverter<&Inverter::dead_time_band_a>(
        "inverter.dead_time_band_a", "A",
        1e-9, 1e6, kLive, "averaged inverter: below it the dead-time error goes to zero linearly"),

    bus<&Bus::voltage_v>("bus.voltage_v", "V", 0, 1e6, kLive,
                         "supply of the DC link; 0: amplifier.voltage_limit_v, twice that in a star"),
    bus<&Bus::resistance_ohm>("bus.resistance_ohm", "ohm", 0, 1e6, kLive,
                              "of the supply of the DC link, with bus.capacitance_f"),
    bus<&Bus::capacitance_f>("bus.capacitance_f", "F", 0, 1e3, kReal, "of the DC link; 0: a stiff link"),
    bus<&Bus::chopper_on_v>("bus.chopper_on_v", "V", 0, 1e6, kLive,
                            "link voltage above which the brake resistor is on; 0: no chopper"),
    bus<&Bus::chopper_off_v>("bus.chopper_off_v", "V", 0, 1e6, kLive,
                             "link voltage below which it is off again"),
    bus<&Bus::chopper_ohm>("bus.chopper_ohm", "ohm", 1e-6, 1e6, kLive, "brake resistor"),

    choice(source<&Source::waveform>(
               "source.waveform", "1", 0, 0, kInteger,
               "sine; trapezoid: flat tops of 120 degrees; table: source.table over a period"),
           kWaveforms),
    source<&Source::amplitude_v>("source.amplitude_v", "V", 0, 1e6, kLive,
                                 "peak of phase a, terminal to neutral in a star"),
    source<&Source::frequency_hz>("source.frequency_hz", "Hz", -1e5, 1e5, kLive,
                                  "0: a DC source; negative: phases in reverse order"),
    source<&Source::phase_rad>("source.phase_rad", "rad", -7, 7, kLive,
                               "phase of phase a at tick 0; a change is a step of the phase"),
    source<&Source::amplitude_factor_b>("source.amplitude_factor_b", "1", -100, 100, kLive,
                                        "amplitude of phase b over that of phase a"),
    source<&Source::amplitude_factor_c>("source.amplitude_factor_c", "1", -100, 100, kLive,
                                        "amplitude of phase c over that of phase a"),
    source<&Source::phase_offset_b_rad>("source.phase_offset_b_rad", "rad", -7, 7, kLive,
                                        "added to the phase of phase b"),
    source<&Source::phase_offset_c_rad>("source.phase_offset_c_rad", "rad", -7, 7, kLive,
                                        "added to the phase of phase c"),
    source<&Source::resistance_ohm>("source.resistance_ohm", "ohm", 0, 1e6, kLive,
                                    "in series with each phase, behind a transformer"),
    source<&Source::inductance_h>("source.inductance_h", "H", 0, 1e3, kReal,
                                  "in series with each phase, behind a transformer"),
    source<&Source::contactor>("source.contactor", "1", 0, 1, kInteger | kLive, "1: closed"),
    source<&Source::choose_angle>("source.choose_angle", "1", 0, 1, kInteger | kLive,
                                  "1: the contactor closes when phase a is at closing_angle_rad"),
    source<&Source::closing_angle_rad>("source.closing_angle_rad", "rad", -7, 7, kLive,
                                       "angle of phase a at which the contactor closes"),
    source<&Source::start_capacitance_f>("source.start_capacitance_f", "F", 0, 10, kReal,
                                         "capacitor that feeds phase b from phase a; 0: none"),
    source<&Source::start_resistance_ohm>("source.start_resistance_ohm", "ohm", 0, 1e6, kLive,
                                          "in series with that capacitor"),
    source<&Source::start_switch>("source.start_switch", "1", 0, 1, kInteger | kLive,
                                  "1: phase b is shorted and its capacitor cut off"),
    source<&Source::field_v>("source.field_v", "V", -1e6, 1e6, kLive,
                             "field supply of any kind of drive; 0: the command has the field voltage"),
});

constexpr auto kDriveCurves = std::to_array<CurveParameter>({
    {.name = "source.table",
     .x_unit = "1",
     .y_unit = "1",
     .required = false,
     .rising = false,
     .meaning = "waveform over the fraction of a period, 0 to 1; amplitude_v times it is the voltage",
     .get = [](const AxisParameters& p) noexcept -> const Curve& { return p.drive.source.table; },
     .set = [](AxisParameters& p, Curve curve) { p.drive.source.table = std::move(curve); }},
});

/// "is <value> but <rule>".
std::string sentence(double value, const std::string& rule) {
  return "is " + text(value) + " but " + rule;
}

void add_loop_problems(const DriveParameters& p, Problems& found) {
  if (p.kind != DriveKind::kCurrent) return;
  constexpr const char* kRule = "must be above 0 with drive.kind = \"current_amplifier\"";
  const auto must_be_positive = [&](const char* field, double value) {
    if (!(value > 0.0)) found.add(field, [&] { return sentence(value, kRule); });
  };
  must_be_positive("current_loop.proportional_v_per_a", p.current_loop.proportional_v_per_a);
  must_be_positive("current_loop.limit_a", p.current_loop.limit_a);
}

void add_bus_problems(const DriveParameters& p, Problems& found) {
  const Bus& b = p.bus;
  if (!(b.chopper_on_v > 0.0)) return;
  if (!(b.capacitance_f > 0.0)) {
    found.add("bus.chopper_on_v", [&] {
      return sentence(b.chopper_on_v,
                      "a chopper needs a link that can rise: bus.capacitance_f must be above 0");
    });
  }
  if (!(b.chopper_off_v < b.chopper_on_v)) {
    found.add("bus.chopper_off_v", [&] {
      return sentence(b.chopper_off_v, "must be below chopper_on_v = " + text(b.chopper_on_v));
    });
  }
  if (!(b.chopper_off_v > b.voltage_v)) {
    found.add("bus.chopper_off_v", [&] {
      return sentence(b.chopper_off_v, "must be above the supply, bus.voltage_v = " + text(b.voltage_v) +
                                           ", or the brake resistor would stay on");
    });
  }
}

void add_source_problems(const DriveParameters& p, Problems& found) {
  if (p.kind != DriveKind::kSource) return;
  const Source& s = p.source;
  if (s.choose_angle && s.frequency_hz == 0.0) {
    found.add("source.choose_angle",
              "is 1 but a source of frequency_hz = 0 never comes to closing_angle_rad");
  }
  if (s.waveform != Waveform::kTable) return;
  if (s.table.empty()) {
    found.add("source.table", "is missing but source.waveform is \"table\"");
  } else if (s.table.points().front().x < 0.0 || s.table.points().back().x > 1.0) {
    found.add("source.table", [&] {
      return "goes from " + text(s.table.points().front().x) + " to " + text(s.table.points().back().x) +
             " but must lie between 0 and 1, a whole period";
    });
  }
}

}  // namespace

std::span<const Parameter> drive_rows() noexcept {
  return kDriveTable;
}

std::span<const CurveParameter> drive_curves() noexcept {
  return kDriveCurves;
}

bool is_of_drive(std::string_view parameter) noexcept {
  const auto has = [parameter](std::span<const Parameter> rows) noexcept {
    return std::ranges::find(rows, parameter, &Parameter::name) != rows.end();
  };
  return has(drive_rows()) || has(transformer_rows());
}

void add_problems(const DriveParameters& p, Problems& found) {
  add_loop_problems(p, found);
  if (p.kind == DriveKind::kSwitched && p.amplifier.filter_hz > 0.0) {
    found.add("amplifier.filter_hz", [&] {
      return sentence(p.amplifier.filter_hz,
                      "must be 0 with drive.kind = \"switched_inverter\", whose diodes hold the terminals");
    });
  }
  add_bus_problems(p, found);
  add_source_problems(p, found);
  add_transformer_problems(p, found);
}

void add_shared_problems(const DriveParameters& p, Problems& found) {
  const auto must_be_zero = [&found](std::string_view name, double value) {
    if (value == 0.0) return;
    found.add(name,
              [&] { return "is " + text(value) + " but must be 0 where two machines share the amplifier"; });
  };
  must_be_zero("inverter.switch_ohm", p.inverter.switch_ohm);
  must_be_zero("inverter.diode_v", p.inverter.diode_v);
  must_be_zero("inverter.break_current_a", p.inverter.break_current_a);
  must_be_zero("inverter.bootstrap_s", p.inverter.bootstrap_s);
  if (p.kind == DriveKind::kCurrent || p.kind == DriveKind::kSource) {
    found.add("drive.kind", [&] {
      return "is \"" + std::string(kDriveKinds[static_cast<std::size_t>(p.kind)]) +
             "\" but two machines share voltage amplifiers and inverters only";
    });
  }
  must_be_zero("amplifier.filter_hz", p.amplifier.filter_hz);
}

void add_period_problems(const DriveParameters& p, double period_s, Problems& found) {
  if (p.kind != DriveKind::kAveraged && p.kind != DriveKind::kSwitched) return;
  const double pwm_period_s = period_s / p.inverter.pwm_periods_per_tick;
  if (!(p.inverter.dead_time_s < 0.5 * pwm_period_s)) {
    found.add("inverter.dead_time_s", [&] {
      return sentence(p.inverter.dead_time_s,
                      "must be below half of the carrier period, which is " + text(pwm_period_s) + " s");
    });
  }
}

}  // namespace drivebench
