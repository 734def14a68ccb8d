#include "plant/machines/shunt_dc/shunt_dc_machine.hpp"

#include <array>

#include "plant/parameters/field_winding_rows.hpp"
#include "plant/parameters/machine_kind.hpp"
#include "plant/train/drive_train_impl.hpp"

namespace drivebench {
namespace {

using ShuntDc = ShuntDcMachineParameters;

constexpr auto kShuntDcTable = std::to_array<Parameter>({
    field_winding_rows::armature_resistance<ShuntDc>(),
    field_winding_rows::armature_inductance<ShuntDc>(),
    field_winding_rows::motor_constant<ShuntDc>(),
    field_winding_rows::field_resistance<ShuntDc>(),
    machine_row<ShuntDc, &ShuntDc::adjusting_resistance_ohm>(
        "machine.adjusting_resistance_ohm", "ohm", 0, 1e6, kLive, "R_adj in series with the field winding"),
    field_winding_rows::field_inductance<ShuntDc>(),
});

constexpr auto kShuntDcCurves =
    std::to_array<CurveParameter>({field_winding_rows::saturation_curve<ShuntDc>()});

/// The rules between the values.
void add_broken_shunt_dc_rules(const ShuntDc& p, Problems& found) {
  field_winding_rows::add_problems(p.field_inductance_h, p.saturation_curve, found);
}

}  // namespace

MachineKind ShuntDcMachine::kind() noexcept {
  return {.name = "shunt_dc",
          .field = FieldSupply::kOnArmature,
          .rows = kShuntDcTable,
          .curves = kShuntDcCurves,
          .add_broken_rules = rules_of<add_broken_shunt_dc_rules>,
          .make_train = make_drive_train<ShuntDcMachine>};
}

}  // namespace drivebench
