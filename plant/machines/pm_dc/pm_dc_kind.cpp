#include "plant/machines/pm_dc/pm_dc_machine.hpp"

#include <array>

#include "plant/parameters/machine_kind.hpp"
#include "plant/parameters/rows.hpp"
#include "plant/train/drive_train_impl.hpp"

namespace drivebench {
namespace {

using PmDc = PmDcMachineParameters;

constexpr auto kPmDcTable = std::to_array<Parameter>({
    machine_row<PmDc, &PmDc::armature_resistance_ohm>("machine.armature_resistance_ohm", "ohm", 1e-6, 1e6,
                                                      kLive | kRequired, "R, brushes included", {1e-4, 500}),
    machine_row<PmDc, &PmDc::armature_inductance_h>("machine.armature_inductance_h", "H", 1e-9, 1e3,
                                                    kRequired, "L", {1e-7, 3}),
    machine_row<PmDc, &PmDc::torque_constant_nm_per_a>(
        "machine.torque_constant_nm_per_a", "N*m/A", 1e-9, 1e6, kLive | kRequired,
        "K_T, torque over current, and K_b, back-emf over speed", {1e-4, 200}),
});

}  // namespace

MachineKind PmDcMachine::kind() noexcept {
  return {.name = "pm_dc", .rows = kPmDcTable, .make_train = make_drive_train<PmDcMachine>};
}

}  // namespace drivebench
