#include "plant/machines/pm_dc/pm_dc_machine_rows.hpp"

#include <array>

#include "plant/parameters/rows.hpp"

namespace drivebench {
namespace {

using Machine = PmDcMachineParameters;

constexpr auto kTable = std::to_array<Parameter>({
    machine_row<Machine, &Machine::armature_resistance_ohm>("machine.armature_resistance_ohm", "ohm", 1e-6,
                                                            1e6, kLive | kRequired, "R, brushes included"),
    machine_row<Machine, &Machine::armature_inductance_h>("machine.armature_inductance_h", "H", 1e-9, 1e3,
                                                          kRequired, "L"),
    machine_row<Machine, &Machine::torque_constant_nm_per_a>(
        "machine.torque_constant_nm_per_a", "N*m/A", 1e-9, 1e6, kLive | kRequired,
        "K_T, torque over current, and K_b, back-emf over speed"),
});

}  // namespace

std::span<const Parameter> pm_dc_machine_rows() noexcept {
  return kTable;
}

void add_problems(const PmDcMachineParameters&, Problems&) {}

}  // namespace drivebench
