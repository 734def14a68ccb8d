#include "clients/identification/refinement/sensor_unknowns.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <string>
#include <string_view>

namespace drivebench::identification {
namespace {

constexpr double kOffset = 0.01;  ///< of the largest signal: a coordinate of 1

constexpr const char* kZero = "angle offset";
constexpr double kZeroScale_rad = 0.01;

std::string column_of(bool current, std::size_t phase) {
  return std::string(current ? "i_" : "u_") + static_cast<char>('a' + phase) + (current ? "_a" : "_v");
}

bool is_sensor(const Estimate& e) {
  return e.name.ends_with(" offset") || e.name.ends_with(" gain");
}

}  // namespace

void add_sensors(const Settings& e, const PredictorRecord& record, Result& result,
                 std::vector<Unknown>& unknowns) {
  const auto add = [&](Estimate error, double scale) {
    unknowns.push_back({.name = error.name, .scale = scale});
    if (result.find(error.name) == nullptr) result.parameters.push_back(std::move(error));
  };
  const std::size_t phases = record.currents.size();
  for (const bool current : {true, false}) {
    const double largest = current ? record.largest_current_a : record.voltages.rms(record.range);
    const bool offsets = current ? e.sensors.current_offsets : e.sensors.voltage_offsets;
    for (std::size_t phase = !current && phases == 3 ? 1 : 0; phase < phases && offsets; ++phase) {
      const std::string name = column_of(current, phase) + " offset";
      add({.name = name, .unit = current ? "A" : "V", .truth = {}}, kOffset * largest);
    }
    for (std::size_t phase = 1; phase < phases && e.sensors.gains; ++phase) {
      const std::string name = column_of(current, phase) + " gain";
      add({.name = name, .unit = "1", .value = 1.0, .truth = {}}, 0.0);
    }
  }
  if (e.sensors.zero) add({.name = kZero, .unit = "rad electrical", .truth = {}}, kZeroScale_rad);
}

SensorErrors errors_of(const Result& result) {
  SensorErrors errors;
  const auto take = [&](const std::string& name, double& value) {
    if (const Estimate* const found = result.find(name)) value = found->value;
  };
  for (std::size_t phase = 0; phase < 3; ++phase) {
    take(column_of(true, phase) + " offset", errors.current_offset_a[phase]);
    take(column_of(true, phase) + " gain", errors.current_gain[phase]);
    take(column_of(false, phase) + " offset", errors.voltage_offset_v[phase]);
    take(column_of(false, phase) + " gain", errors.voltage_gain[phase]);
  }
  take(kZero, errors.angle_offset_rad);
  return errors;
}

void set_apart(const Settings& e, const std::vector<Unknown>& unknowns, bool explained, Result& result) {
  constexpr double kWidest = 0.1;
  for (const Unknown& unknown : unknowns) {
    Estimate& error = *result.find(unknown.name);
    if (!is_sensor(error)) continue;
    const double widest = unknown.scale > 0.0 ? kWidest / kOffset * unknown.scale : kWidest;
    if (!explained || !(error.interval.value_or(HUGE_VAL) < widest)) error.interval.reset();
  }
  const auto motor = std::stable_partition(result.parameters.begin(), result.parameters.end(),
                                           [](const Estimate& each) { return !is_sensor(each); });
  std::move(motor, result.parameters.end(), std::back_inserter(result.sensors));
  result.parameters.erase(motor, result.parameters.end());
  if (e.sensors.current_offsets && e.sensors.voltage_offsets)
    result.notes.emplace_back(
        "an offset of a voltage and R times that of its current look alike but for the torque: their "
        "intervals say how "
        "far the data tell them apart");
  if (e.sensors.gains)
    result.notes.emplace_back(
        "gains are those against phase a: a gain that all currents share, or all voltages, goes into the "
        "parameters "
        "as it is, and so does that of the encoder");
}

}  // namespace drivebench::identification
