#include "plant/machines/shunt_dc/shunt_dc_machine_rows.hpp"

#include <array>

#include "plant/machines/field_winding_rows.hpp"

namespace drivebench {
namespace {

using Machine = ShuntDcMachineParameters;

constexpr auto kTable = std::to_array<Parameter>({
    field_winding_rows::armature_resistance<Machine>(),
    field_winding_rows::armature_inductance<Machine>(),
    field_winding_rows::motor_constant<Machine>(),
    field_winding_rows::field_resistance<Machine>(),
    machine_row<Machine, &Machine::adjusting_resistance_ohm>(
        "machine.adjusting_resistance_ohm", "ohm", 0, 1e6, kLive, "R_adj in series with the field winding"),
    field_winding_rows::field_inductance<Machine>(),
});

constexpr auto kCurves = std::to_array<CurveParameter>({field_winding_rows::saturation_curve<Machine>()});

}  // namespace

std::span<const Parameter> shunt_dc_machine_rows() noexcept {
  return kTable;
}

std::span<const CurveParameter> shunt_dc_machine_curves() noexcept {
  return kCurves;
}

void add_problems(const ShuntDcMachineParameters& p, Problems& found) {
  field_winding_rows::add_problems(p.field_inductance_h, p.saturation_curve, found);
}

}  // namespace drivebench
