#include "server/endpoints/modbus/map_info.hpp"

#include <algorithm>
#include <array>
#include <bit>

#include "plant/faults.hpp"
#include "plant/injected_faults.hpp"
#include "plant/parameters/parameters.hpp"
#include "protocols/modbus/map_text.hpp"

namespace drivebench::modbus {
namespace {

/// The parameters of the first map, whose addresses stay.
constexpr auto kFirstParameters = std::to_array<std::string_view>({
    "machine.pole_pairs",           "machine.stator_resistance_ohm",  "machine.rotor_resistance_ohm",
    "machine.stator_inductance_h",  "machine.rotor_inductance_h",     "machine.mutual_inductance_h",
    "mechanics.inertia_kgm2",       "mechanics.viscous_friction_nms", "mechanics.coulomb_friction_nm",
    "mechanics.static_friction_nm", "amplifier.voltage_limit_v",      "amplifier.gain",
    "amplifier.offset_a_v",         "amplifier.offset_b_v",           "amplifier.over_current_a",
    "amplifier.over_current_trip",  "encoder.counts_per_revolution",  "encoder.half_count_offset",
    "current_sensor.bits",          "current_sensor.full_scale_a",    "current_sensor.gain_a",
    "current_sensor.gain_b",        "current_sensor.offset_a_a",      "current_sensor.offset_b_a",
    "current_sensor.noise_rms_a",
});

std::vector<FaultInput> fault_inputs() {
  std::vector<FaultInput> faults;
  faults.reserve(kFaultTable.size() + kInjectableFaultCount);
  for (const FaultInfo& fault : kFaultTable) {
    faults.push_back({.address = static_cast<std::size_t>(std::countr_zero(fault.bit)),
                      .bit = {.name = fault.name, .meaning = fault.meaning}});
  }
  static_assert(kInjectableFaultCount <= kInjectedInputs);
  for (std::size_t row = 0; row < kInjectableFaultCount; ++row) {
    const InjectableFault& fault = kInjectableFaults[row];
    faults.push_back(
        {.address = kFirstInjectedInput + row, .bit = {.name = fault.name, .meaning = fault.meaning}});
  }
  return faults;
}

}  // namespace

std::vector<std::uint32_t> parameter_rows(const AxisParameters& axis) {
  const std::span<const Parameter> table = axis_parameters(axis);
  std::vector<std::uint32_t> rows;
  for (const std::string_view name : kFirstParameters) {
    if (const Parameter* const row = find_parameter(axis, name))
      rows.push_back(static_cast<std::uint32_t>(row - table.data()));
  }
  for (std::uint32_t row = 0; row < table.size(); ++row) {
    if (std::find(rows.begin(), rows.end(), row) == rows.end()) rows.push_back(row);
  }
  return rows;
}

std::vector<ParameterInfo> parameter_infos(const AxisParameters& axis) {
  std::vector<ParameterInfo> infos;
  for (const std::uint32_t row : parameter_rows(axis)) {
    const Parameter& p = axis_parameters(axis)[row];
    infos.push_back({.name = p.name,
                     .unit = p.unit,
                     .minimum = p.minimum,
                     .maximum = p.maximum,
                     .live = p.live,
                     .meaning = p.meaning});
  }
  return infos;
}

std::vector<RegisterMap> maps_of(const BenchConfig& config) {
  std::vector<RegisterMap> maps;
  for (const AxisSetup& axis : config.setup.axes)
    maps.emplace_back(parameter_infos(axis.parameters), config.modbus.allow_writes);
  return maps;
}

std::string map_of(const BenchConfig& config, bool csv) {
  const std::vector<RegisterMap> maps = maps_of(config);
  const std::vector<FaultInput> faults = fault_inputs();
  std::vector<std::string_view> axes;
  for (const AxisConfig& axis : config.axes)
    axes.push_back(axis.name);
  return csv ? map_csv(maps, faults) : map_markdown(maps, faults, axes);
}

}  // namespace drivebench::modbus
