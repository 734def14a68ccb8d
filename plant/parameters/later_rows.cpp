#include "plant/parameters/later_rows.hpp"

#include <array>

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

using Comparator = ComparatorParameters;

constexpr auto kTable = std::to_array<Parameter>({
    row<&AxisParameters::sensors, &SensorParameters::terminals>(
        "voltage_sensor.against_rail", "1", 0, 1, kInteger | kLater,
        "1: the terminals are shown against the negative rail too, terminal_a_v and so on"),
    row<&AxisParameters::drive, &DriveParameters::bus, &BusParameters::battery>(
        "bus.battery", "1", 0, 1, kInteger | kLater,
        "1: the supply of the link takes current back, through its resistance; 0: a rectifier"),
    comparator_row<&Comparator::enabled>("comparator.enabled", "1", 0, 1, kInteger,
                                         "1: comparators of the terminals, comparator_levels and so on"),
    choice(
        comparator_row<&Comparator::reference>(
            "comparator.reference", "1", 0, 0, kInteger,
            "what a terminal is compared with: the mean of all three, the middle of the link, reference_v"),
        kReferences),
    comparator_row<&Comparator::reference_v>("comparator.reference_v", "V", -1e6, 1e6, kLive,
                                             "against the negative rail, with reference = \"fixed\""),
    comparator_row<&Comparator::rc_s>("comparator.rc_s", "s", 0, 1, kLive,
                                      "time constant of the RC of terminal and reference; 0: none"),
    comparator_row<&Comparator::hysteresis_v>(
        "comparator.hysteresis_v", "V", 0, 1e6, kLive,
        "the level rises above half of it and falls below minus half of it; at the terminal"),
    comparator_row<&Comparator::offset_a_v>("comparator.offset_a_v", "V", -1e6, 1e6, kLive,
                                            "added to what the comparator of a sees"),
    comparator_row<&Comparator::offset_b_v>("comparator.offset_b_v", "V", -1e6, 1e6, kLive,
                                            "added to what the comparator of b sees"),
    comparator_row<&Comparator::offset_c_v>("comparator.offset_c_v", "V", -1e6, 1e6, kLive,
                                            "added to what the comparator of c sees"),
    comparator_row<&Comparator::noise_rms_v>("comparator.noise_rms_v", "V", 0, 1e6, kLive,
                                             "Gaussian, new each microsecond, in each comparator its own"),
    row<&AxisParameters::sensors, &SensorParameters::counts>(
        "converter.counts", "1", 0, 1, kInteger | kLater,
        "1: the numbers of the converters are shown, i_a_counts and so on: 2^(bits - 1) for a reading of 0"),
    row<&AxisParameters::encoder, &EncoderParameters::timer_bits>(
        "encoder.timer_bits", "bit", 0, 32, kInteger | kLater,
        "of the timers of encoder_timer and encoder_capture; 0: there are none"),
    row<&AxisParameters::encoder, &EncoderParameters::capture_hz>(
        "encoder.capture_hz", "Hz", 0, 1e9, kLater,
        "clock of the timer that measures the time between edges, encoder_capture; 0: there is none"),
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

}  // namespace

std::span<const Parameter> later_rows() noexcept {
  return kTable;
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

}  // namespace drivebench
