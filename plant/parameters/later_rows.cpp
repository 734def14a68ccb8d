#include "plant/parameters/later_rows.hpp"

#include <array>
#include <numbers>

#include "plant/parameters/rows.hpp"

namespace drivebench {
namespace {

constexpr auto kReferences = std::to_array<std::string_view>({"virtual_neutral", "half_link", "fixed"});

template <auto Member>
constexpr Parameter comparator_row(std::string_view name, std::string_view unit, double minimum,
                                   double maximum, unsigned traits, std::string_view meaning) {
  return row<&AxisParameters::sensors, &SensorParameters::comparator, Member>(name, unit, minimum, maximum,
                                                                              traits | kLater, meaning);
}

constexpr auto kShuntPlaces = std::to_array<std::string_view>({"inline", "low_side", "link"});

template <auto Member>
constexpr auto inverter_row = row<&AxisParameters::drive, &DriveParameters::inverter, Member>;
template <auto Member>
constexpr auto ntc = row<&AxisParameters::sensors, &SensorParameters::ntc, Member>;
template <auto Member>
constexpr auto absolute = row<&AxisParameters::sensors, &SensorParameters::absolute, Member>;
template <auto Member>
constexpr auto hall = row<&AxisParameters::sensors, &SensorParameters::hall, Member>;
template <auto Member>
constexpr auto shunts = row<&AxisParameters::sensors, &SensorParameters::shunts, Member>;

using Comparator = ComparatorParameters;
using Inverter = InverterParameters;

constexpr auto kLaterTable = std::to_array<Parameter>({
    row<&AxisParameters::sensors, &SensorParameters::terminals>(
        "voltage_sensor.against_rail", "1", 0, 1, kInteger | kLater,
        "1: terminal_a_v and so on, against the negative rail"),
    row<&AxisParameters::drive, &DriveParameters::bus, &BusParameters::battery>(
        "bus.battery", "1", 0, 1, kInteger | kLater, "1: the supply takes current back; 0: a rectifier"),
    comparator_row<&Comparator::enabled>("comparator.enabled", "1", 0, 1, kInteger,
                                         "1: comparators of the terminals"),
    choice(comparator_row<&Comparator::reference>("comparator.reference", "1", 0, 0, kInteger,
                                                  "what a terminal is compared with"),
           kReferences),
    comparator_row<&Comparator::reference_v>("comparator.reference_v", "V", -1e6, 1e6, kLive,
                                             "against the negative rail, with reference = \"fixed\""),
    comparator_row<&Comparator::rc_s>("comparator.rc_s", "s", 0, 1, kLive,
                                      "time constant of the RC of terminal and reference; 0: none"),
    comparator_row<&Comparator::hysteresis_v>("comparator.hysteresis_v", "V", 0, 1e6, kLive,
                                              "the level changes at plus and minus half of it"),
    comparator_row<&Comparator::offset_a_v>("comparator.offset_a_v", "V", -1e6, 1e6, kLive,
                                            "added to the input of a"),
    comparator_row<&Comparator::offset_b_v>("comparator.offset_b_v", "V", -1e6, 1e6, kLive,
                                            "added to the input of b"),
    comparator_row<&Comparator::offset_c_v>("comparator.offset_c_v", "V", -1e6, 1e6, kLive,
                                            "added to the input of c"),
    comparator_row<&Comparator::noise_rms_v>("comparator.noise_rms_v", "V", 0, 1e6, kLive,
                                             "Gaussian, new each microsecond, in each its own"),
    row<&AxisParameters::sensors, &SensorParameters::counts>(
        "converter.counts", "1", 0, 1, kInteger | kLater,
        "1: numbers of the converters, i_a_counts and so on"),
    row<&AxisParameters::encoder, &EncoderParameters::timer_bits>(
        "encoder.timer_bits", "bit", 0, 32, kInteger | kLater,
        "of encoder_timer and encoder_capture; 0: none"),
    row<&AxisParameters::encoder, &EncoderParameters::capture_hz>("encoder.capture_hz", "Hz", 0, 1e9, kLater,
                                                                  "clock of encoder_capture; 0: none"),
    inverter_row<&Inverter::switch_ohm>("inverter.switch_ohm", "ohm", 0, 1e3, kLive | kLater,
                                        "R_ds(on) of a closed switch"),
    inverter_row<&Inverter::diode_v>("inverter.diode_v", "V", 0, 100, kLive | kLater,
                                     "forward voltage of a diode"),
    inverter_row<&Inverter::break_current_a>(
        "inverter.break_current_a", "A", 0, 1e6, kLive | kLater,
        "a phase current beyond it opens all legs until cleared; 0: none"),
    inverter_row<&Inverter::break_delay_s>("inverter.break_delay_s", "s", 0, 1e-2, kLive | kLater,
                                           "from the cause until the legs are open"),
    choice(shunts<&ShuntParameters::place>(
               "current_sensor.place", "1", 0, 0, kInteger | kLater,
               "inline: wires; low_side: lower switches; link: i_a and i_b are conversions of it"),
           kShuntPlaces),
    shunts<&ShuntParameters::sample_s>("current_sensor.sample_s", "s", 0, 1, kLater,
                                       "first conversion, in the tick before the sample; 0: at its end"),
    shunts<&ShuntParameters::conversion_s>("current_sensor.conversion_s", "s", 0, 1, kLater,
                                           "from one conversion to the next; 0: all at once"),
    ntc<&NtcParameters::ohm>("temperature_sensor.ntc_ohm", "ohm", 0, 1e9, kLater,
                             "thermistor at 25 degrees Celsius; 0: none"),
    ntc<&NtcParameters::beta_k>("temperature_sensor.ntc_beta_k", "K", 0, 1e5, kLater,
                                "B of R = R_25 exp(B (1/T - 1/298.15 K))"),
    ntc<&NtcParameters::pull_ohm>("temperature_sensor.ntc_pull_ohm", "ohm", 0, 1e9, kLater,
                                  "resistor to the reference of the converter"),
    shunts<&ShuntParameters::sample_angle_rad>("current_sensor.sample_angle_rad", "rad", 0,
                                               2.0 * std::numbers::pi, kLater,
                                               "in place of sample_s: angle of the PWM period; 0: none"),
    absolute<&AbsoluteEncoderParameters::bits>("absolute_encoder.bits", "bit", 0, kMaxAbsoluteBits,
                                               kInteger | kLater, "of absolute_angle; 0: none"),
    absolute<&AbsoluteEncoderParameters::latency_s>("absolute_encoder.latency_s", "s", 0, 1, kLater,
                                                    "age of the angle"),
    absolute<&AbsoluteEncoderParameters::offset_rad>("absolute_encoder.offset_rad", "rad", -6.3, 6.3, kLater,
                                                     "added to the angle"),
    hall<&HallParameters::capture_bits>("hall.capture_bits", "bit", 0, 32, kInteger | kLater,
                                        "of hall_capture; 0: none"),
    hall<&HallParameters::capture_hz>("hall.capture_hz", "Hz", 0, 1e9, kLater, "clock of hall_capture"),
    inverter_row<&Inverter::bootstrap_s>("inverter.bootstrap_s", "s", 0, 1e3, kLater,
                                         "an upper switch opens after it; 0: never"),
    inverter_row<&Inverter::bootstrap_recharge_s>("inverter.bootstrap_recharge_s", "s", 0, 1e3, kLater,
                                                  "a lower switch makes up for that within it"),
});

bool has_bits(const SensorParameters& p) noexcept {
  const auto counts = [](const AnalogParameters& each) { return each.enabled && each.bits > 0; };
  return p.current.bits > 0 || counts(p.voltage) || counts(p.bus) || counts(p.temperature);
}

void add_comparator_problems(const AxisParameters& p, Problems& found) {
  if (!p.sensors.comparator.enabled) return;
  if (p.drive.kind == DriveKind::kSource) {
    found.add("comparator.enabled", "is 1 but must be 0 with drive.kind = \"source\", which has no rails");
  }
  if (connection_of(p.machine) != Connection::kStar) {
    found.add("comparator.enabled", "is 1 but needs a machine with three phases in a star");
  }
  if (!(p.sensors.comparator.hysteresis_v > 0.0)) {
    found.add("comparator.hysteresis_v", [&] {
      return "is " + text(p.sensors.comparator.hysteresis_v) +
             " V but must be above 0 while comparator.enabled is 1";
    });
  }
}

void add_switch_problems(const DriveParameters& p, Problems& found) {
  const auto needs = [&found](std::string_view name, double value, std::string_view what) {
    found.add(name, [&] { return "is " + text(value) + " but must be 0 " + std::string(what); });
  };
  constexpr std::string_view kSwitched = "unless drive.kind is \"switched_inverter\"";
  if (p.kind != DriveKind::kSwitched) {
    if (p.inverter.switch_ohm != 0.0) needs("inverter.switch_ohm", p.inverter.switch_ohm, kSwitched);
    if (p.inverter.diode_v != 0.0) needs("inverter.diode_v", p.inverter.diode_v, kSwitched);
  }
  if (p.kind != DriveKind::kSwitched && p.kind != DriveKind::kAveraged && p.inverter.break_current_a != 0.0) {
    needs("inverter.break_current_a", p.inverter.break_current_a, "unless drive.kind is an inverter");
  }
}

void add_bootstrap_problems(const AxisParameters& p, Problems& found) {
  const InverterParameters& inverter = p.drive.inverter;
  if (inverter.bootstrap_s > 0.0 &&
      (p.drive.kind != DriveKind::kSwitched || connection_of(p.machine) != Connection::kStar)) {
    found.add("inverter.bootstrap_s", [&] {
      return "is " + text(inverter.bootstrap_s) +
             " s but needs drive.kind = \"switched_inverter\" and a machine with three phases in a star";
    });
  }
  if (inverter.bootstrap_recharge_s > 0.0 && inverter.bootstrap_s == 0.0) {
    found.add("inverter.bootstrap_recharge_s", [&] {
      return "is " + text(inverter.bootstrap_recharge_s) + " s but must be 0 where inverter.bootstrap_s is 0";
    });
  }
}

void add_position_problems(const SensorParameters& p, Problems& found) {
  if (p.absolute.bits == 0 && p.absolute.latency_s > 0.0) {
    found.add("absolute_encoder.latency_s", [&] {
      return "is " + text(p.absolute.latency_s) + " s but needs absolute_encoder.bits above 0, which is 0";
    });
  }
  if (p.absolute.bits == 0 && p.absolute.offset_rad != 0.0) {
    found.add("absolute_encoder.offset_rad", [&] {
      return "is " + text(p.absolute.offset_rad) + " rad but needs absolute_encoder.bits above 0, which is 0";
    });
  }
  const bool clocked = p.hall.capture_hz > 0.0;
  if (clocked != (p.hall.capture_bits > 0)) {
    found.add("hall.capture_hz", [&] {
      return "is " + text(p.hall.capture_hz) + " Hz and hall.capture_bits " + text(p.hall.capture_bits) +
             ": both must be above 0, or none";
    });
  } else if (clocked && !p.hall.enabled) {
    found.add("hall.capture_bits",
              [&] { return "is " + text(p.hall.capture_bits) + " but needs hall.enabled = 1, which is 0"; });
  }
}

void add_angle_problems(const AxisParameters& p, Problems& found) {
  const ShuntParameters& s = p.sensors.shunts;
  if (s.sample_angle_rad == 0.0) return;
  const auto is_but = [&](std::string_view rule) {
    found.add("current_sensor.sample_angle_rad",
              [&] { return "is " + text(s.sample_angle_rad) + " rad but " + std::string(rule); });
  };
  if (p.drive.kind != DriveKind::kSwitched && p.drive.kind != DriveKind::kAveraged) {
    is_but("must be 0 unless drive.kind is an inverter, which has a PWM period");
  }
  if (s.sample_s > 0.0) is_but("must be 0 where current_sensor.sample_s gives the instant");
}

void add_shunt_problems(const AxisParameters& p, Problems& found) {
  const ShuntParameters& s = p.sensors.shunts;
  const auto place = static_cast<std::size_t>(s.place);
  if (place >= kShuntPlaces.size()) return;  // the limits of its row say so
  if (s.place != ShuntPlace::kInline &&
      (p.drive.kind != DriveKind::kSwitched || connection_of(p.machine) != Connection::kStar)) {
    found.add("current_sensor.place", [&] {
      return "is \"" + std::string(kShuntPlaces[place]) +
             "\" but needs drive.kind = \"switched_inverter\" and a machine with three phases in a star";
    });
  }
  if (s.place == ShuntPlace::kLink && !(s.has_instant() && s.conversion_s > 0.0)) {
    found.add("current_sensor.place",
              "is \"link\" but needs current_sensor.sample_s or sample_angle_rad, and conversion_s, above 0: "
              "two instants");
  }
  if (s.conversion_s > 0.0 && !s.has_instant()) {
    found.add("current_sensor.conversion_s", [&] {
      return "is " + text(s.conversion_s) +
             " s but must be 0 where current_sensor.sample_s and sample_angle_rad are 0";
    });
  }
  add_angle_problems(p, found);
  if (!s.used()) return;
  if (p.sensors.current.filter_hz > 0.0) {
    found.add("current_sensor.filter_hz", [&] {
      return "is " + text(p.sensors.current.filter_hz) +
             " Hz but must be 0 with current_sensor.place, sample_s or sample_angle_rad: the filter is that "
             "of the wires";
    });
  }
  if (p.sensors.current.delay_ticks == 0.5) {
    found.add("current_sensor.delay_ticks",
              "is 0.5 but must be whole with current_sensor.place, sample_s or sample_angle_rad, which give "
              "the instant");
  }
}

void add_ntc_problems(const SensorParameters& p, Problems& found) {
  if (p.ntc.ohm == 0.0) return;
  if (!(p.ntc.beta_k > 0.0 && p.ntc.pull_ohm > 0.0)) {
    found.add("temperature_sensor.ntc_ohm",
              "needs temperature_sensor.ntc_beta_k and ntc_pull_ohm above 0: the divider of the thermistor");
  }
  if (!(p.counts && p.temperature.enabled && p.temperature.bits > 0)) {
    found.add("temperature_sensor.ntc_ohm",
              "needs converter.counts and a temperature_sensor that is enabled with bits");
  }
}

}  // namespace

std::span<const Parameter> later_rows() noexcept {
  return kLaterTable;
}

void add_later_problems(const AxisParameters& p, Problems& found) {
  if (p.sensors.terminals && p.drive.kind == DriveKind::kSource) {
    found.add("voltage_sensor.against_rail",
              "is 1 but must be 0 with drive.kind = \"source\", which has no rails");
  }
  if (p.drive.bus.battery && !(p.drive.bus.capacitance_f > 0.0)) {
    found.add("bus.battery", [&] {
      return "is 1 but needs bus.capacitance_f above 0, which is " + text(p.drive.bus.capacitance_f) +
             ": a link without a capacitor is stiff and takes back all";
    });
  }
  add_comparator_problems(p, found);
  add_switch_problems(p.drive, found);
  add_shunt_problems(p, found);
  add_ntc_problems(p.sensors, found);
  add_position_problems(p.sensors, found);
  add_bootstrap_problems(p, found);
  if (p.sensors.counts && !has_bits(p.sensors)) {
    found.add("converter.counts",
              "is 1 but no converter has bits: current_sensor.bits, or voltage_sensor, bus_sensor or "
              "temperature_sensor enabled with bits");
  }
  if (p.encoder.capture_hz > 0.0 && p.encoder.timer_bits == 0) {
    found.add("encoder.capture_hz", [&] {
      return "is " + text(p.encoder.capture_hz) + " Hz but needs encoder.timer_bits above 0, which is 0";
    });
  }
}

namespace {

void add_conversion_problems(const AxisParameters& p, double period_s, Problems& found) {
  const ShuntParameters& s = p.sensors.shunts;
  const std::size_t last = s.place == ShuntPlace::kLink ? 1 : 2;
  const double last_s = s.instant_s(last, period_s, p.drive.inverter.pwm_periods_per_tick);
  if (last_s <= period_s) return;
  const bool by_angle = s.sample_angle_rad > 0.0;
  found.add(by_angle ? "current_sensor.sample_angle_rad" : "current_sensor.sample_s", [&] {
    return "is " + (by_angle ? text(s.sample_angle_rad) + " rad" : text(s.sample_s) + " s") +
           ": the last conversion at " + text(last_s) + " s must lie within the tick, which is " +
           text(period_s) + " s";
  });
}

}  // namespace

void add_period_problems(const AxisParameters& p, double period_s, Problems& found) {
  add_conversion_problems(p, period_s, found);
  const double latency_s = p.sensors.absolute.latency_s;
  const double most_s = kMaxSensorDelayTicks * period_s;
  if (latency_s <= most_s) return;
  found.add("absolute_encoder.latency_s", [&] {
    return "is " + text(latency_s) + " s but may be at most " + text(kMaxSensorDelayTicks) + " ticks, " +
           text(most_s) + " s";
  });
}

}  // namespace drivebench
