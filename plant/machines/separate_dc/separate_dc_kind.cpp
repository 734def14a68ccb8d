#include "plant/machines/separate_dc/separate_dc_machine.hpp"

#include <array>

#include "plant/parameters/field_winding_rows.hpp"
#include "plant/parameters/machine_kind.hpp"
#include "plant/train/drive_train_impl.hpp"

namespace drivebench {
namespace {

using SeparateDc = SeparateDcMachineParameters;

constexpr auto kSeparateDcTable = std::to_array<Parameter>({
    field_winding_rows::armature_resistance<SeparateDc>(),
    field_winding_rows::armature_inductance<SeparateDc>(),
    field_winding_rows::motor_constant<SeparateDc>(),
    field_winding_rows::field_resistance<SeparateDc>(),
    field_winding_rows::field_inductance<SeparateDc>(),
    machine_row<SeparateDc, &SeparateDc::field_coupling>(
        "machine.field_coupling", "1", 0, 1, kInteger | kLive,
        "1: a changing field induces a voltage in the armature, "
        "as in the book's full model, whose energy does "
        "not balance"),
    machine_row<SeparateDc, &SeparateDc::armature_loops>(
        "machine.armature_loops", "1", 1, 1000, kInteger,
        "n, loops in each parallel path; for field_coupling only"),
});

constexpr auto kSeparateDcCurves =
    std::to_array<CurveParameter>({field_winding_rows::saturation_curve<SeparateDc>()});

/// The rules between the values.
void add_broken_separate_dc_rules(const SeparateDc& p, Problems& found) {
  field_winding_rows::add_problems(p.field_inductance_h, p.saturation_curve, found);
}

}  // namespace

MachineKind SeparateDcMachine::kind() noexcept {
  return {.name = "separately_excited_dc",
          .field = FieldSupply::kOwnTerminals,
          .rows = kSeparateDcTable,
          .curves = kSeparateDcCurves,
          .add_broken_rules = rules_of<add_broken_separate_dc_rules>,
          .make_train = make_drive_train<SeparateDcMachine>};
}

}  // namespace drivebench
