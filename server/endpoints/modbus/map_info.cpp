#include "server/endpoints/modbus/map_info.hpp"

#include <bit>

#include "plant/faults.hpp"
#include "plant/parameters.hpp"
#include "protocols/modbus/map_text.hpp"

namespace drivebench::modbus {

std::vector<ParameterInfo> parameter_infos() {
  std::vector<ParameterInfo> infos;
  for (const Parameter& p : axis_parameters()) {
    infos.push_back({.name = p.name,
                     .unit = p.unit,
                     .minimum = p.minimum,
                     .maximum = p.maximum,
                     .live = p.live,
                     .meaning = p.meaning});
  }
  return infos;
}

std::string map_of(const BenchConfig& config, bool csv) {
  const std::vector<ParameterInfo> parameters = parameter_infos();
  const RegisterMap map(parameters, config.modbus.allow_writes);
  std::vector<FaultInput> faults;
  faults.reserve(kFaultTable.size());
  for (const FaultInfo& fault : kFaultTable) {
    faults.push_back({.address = static_cast<std::size_t>(std::countr_zero(fault.bit)),
                      .bit = {.name = fault.name, .meaning = fault.meaning}});
  }
  std::vector<std::string_view> axes;
  for (const AxisConfig& axis : config.axes)
    axes.push_back(axis.name);
  return csv ? map_csv(map, faults) : map_markdown(map, faults, axes);
}

}  // namespace drivebench::modbus
