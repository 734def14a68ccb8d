#include "plant/parameters/later_rows.hpp"

#include <array>

#include "plant/parameters/rows.hpp"

namespace drivebench {
namespace {

constexpr auto kTable = std::to_array<Parameter>({
    row<&AxisParameters::sensors, &SensorParameters::terminals>(
        "voltage_sensor.against_rail", "1", 0, 1, kInteger | kLater,
        "1: the terminals are shown against the negative rail too, terminal_a_v and so on"),
    row<&AxisParameters::drive, &DriveParameters::bus, &BusParameters::battery>(
        "bus.battery", "1", 0, 1, kInteger | kLater,
        "1: the supply of the link takes current back, through its resistance; 0: a rectifier"),
});

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
}

}  // namespace drivebench
