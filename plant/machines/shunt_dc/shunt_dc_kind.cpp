#include "plant/machines/shunt_dc/shunt_dc_machine.hpp"

#include <array>

#include "plant/parameters/field_winding_rows.hpp"
#include "plant/parameters/machine_kind.hpp"
#include "plant/train/drive_train_impl.hpp"

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

/// The rules between the values.
void add_broken_rules(const Machine& p, Problems& found) {
  field_winding_rows::add_problems(p.field_inductance_h, p.saturation_curve, found);
}

}  // namespace

MachineKind ShuntDcMachine::kind() noexcept {
  return {.name = "shunt_dc",
          .field = FieldSupply::kOnArmature,
          .rows = kTable,
          .curves = kCurves,
          .add_broken_rules = rules_of<add_broken_rules>,
          .make_train = make_drive_train<ShuntDcMachine>};
}

}  // namespace drivebench
