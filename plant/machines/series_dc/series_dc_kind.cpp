#include "plant/machines/series_dc/series_dc_machine.hpp"

#include <array>

#include "plant/parameters/field_winding_rows.hpp"
#include "plant/parameters/machine_kind.hpp"
#include "plant/train/drive_train_impl.hpp"

namespace drivebench {
namespace {

using SeriesDc = SeriesDcMachineParameters;

constexpr auto kSeriesDcTable = std::to_array<Parameter>({
    field_winding_rows::armature_resistance<SeriesDc>(),
    field_winding_rows::armature_inductance<SeriesDc>(),
    field_winding_rows::motor_constant<SeriesDc>(),
    field_winding_rows::field_resistance<SeriesDc>(),
    field_winding_rows::field_inductance<SeriesDc>(),
    machine_row<SeriesDc, &SeriesDc::field_shunt_resistance_ohm>(
        "machine.field_shunt_resistance_ohm", "ohm", 0, 1e6, kReal,
        "R_p, which machine.field_shunt lays across the field; 0: there is none"),
    machine_row<SeriesDc, &SeriesDc::field_shunt>("machine.field_shunt", "1", 0, 1, kInteger | kLive,
                                                  "1: R_p is across the field and weakens it"),
});

constexpr auto kSeriesDcCurves =
    std::to_array<CurveParameter>({field_winding_rows::saturation_curve<SeriesDc>()});

/// The rules between the values.
void add_broken_series_dc_rules(const SeriesDc& p, Problems& found) {
  field_winding_rows::add_problems(p.field_inductance_h, p.saturation_curve, found);
  if (p.field_shunt && p.field_shunt_resistance_ohm == 0.0) {
    found.add("machine.field_shunt",
              "is 1 but must be 0 without a resistor: machine.field_shunt_resistance_ohm is 0");
  }
}

}  // namespace

MachineKind SeriesDcMachine::kind() noexcept {
  return {.name = "series_dc",
          .field = FieldSupply::kOnArmature,
          .rows = kSeriesDcTable,
          .curves = kSeriesDcCurves,
          .add_broken_rules = rules_of<add_broken_series_dc_rules>,
          .make_train = make_drive_train<SeriesDcMachine>};
}

}  // namespace drivebench
