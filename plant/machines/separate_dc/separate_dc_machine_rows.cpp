#include "plant/machines/separate_dc/separate_dc_machine_rows.hpp"

#include <array>

#include "plant/machines/field_winding_rows.hpp"

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

}  // namespace

std::span<const Parameter> separate_dc_machine_rows() noexcept {
  return kTable;
}

std::span<const CurveParameter> separate_dc_machine_curves() noexcept {
  return kCurves;
}

void add_problems(const SeparateDcMachineParameters& p, Problems& found) {
  field_winding_rows::add_problems(p.field_inductance_h, p.saturation_curve, found);
}

}  // namespace drivebench
