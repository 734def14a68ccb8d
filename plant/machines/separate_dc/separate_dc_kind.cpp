#include "plant/machines/separate_dc/separate_dc_machine.hpp"

#include <array>

#include "plant/parameters/field_winding_rows.hpp"
#include "plant/parameters/machine_kind.hpp"
#include "plant/train/drive_train_impl.hpp"

namespace drivebench {
namespace {

using Machine = SeparateDcMachineParameters;

constexpr auto kTable = std::to_array<Parameter>({
    field_winding_rows::armature_resistance<Machine>(),
    field_winding_rows::armature_inductance<Machine>(),
    field_winding_rows::motor_constant<Machine>(),
    field_winding_rows::field_resistance<Machine>(),
    field_winding_rows::field_inductance<Machine>(),
    machine_row<Machine, &Machine::field_coupling>("machine.field_coupling", "1", 0, 1, kInteger | kLive,
                                                   "1: a changing field induces a voltage in the armature, "
                                                   "as in the book's full model, whose energy does "
                                                   "not balance"),
    machine_row<Machine, &Machine::armature_loops>("machine.armature_loops", "1", 1, 1000, kInteger,
                                                   "n, loops in each parallel path; for field_coupling only"),
});

constexpr auto kCurves = std::to_array<CurveParameter>({field_winding_rows::saturation_curve<Machine>()});

/// The rules between the values.
void add_broken_rules(const Machine& p, Problems& found) {
  field_winding_rows::add_problems(p.field_inductance_h, p.saturation_curve, found);
}

}  // namespace

MachineKind SeparateDcMachine::kind() noexcept {
  return {.name = "separately_excited_dc",
          .field = FieldSupply::kOwnTerminals,
          .rows = kTable,
          .curves = kCurves,
          .add_broken_rules = rules_of<add_broken_rules>,
          .make_train = make_drive_train<SeparateDcMachine>};
}

}  // namespace drivebench
