#include "plant/machines/pm/pm_machine.hpp"

#include <array>

#include "plant/parameters/machine_kind.hpp"
#include "plant/parameters/rows.hpp"
#include "plant/train/drive_train_impl.hpp"

namespace drivebench {
namespace {

using Pm = PmMachineParameters;

constexpr auto kPmTable = std::to_array<Parameter>({
    machine_row<Pm, &Pm::pole_pairs>("machine.pole_pairs", "1", 1, 1000, kInteger | kRequired,
                                     "n_p; of a hybrid stepping motor the teeth of its rotor", {1, 200}),
    machine_row<Pm, &Pm::stator_resistance_ohm>("machine.stator_resistance_ohm", "ohm", 1e-6, 1e6,
                                                kLive | kRequired, "R_S, two-phase equivalent", {1e-4, 500}),
    machine_row<Pm, &Pm::inductance_d_h>("machine.inductance_d_h", "H", 1e-9, 1e3, kRequired,
                                         "L_d along the magnet, two-phase equivalent", {1e-7, 0.5}),
    machine_row<Pm, &Pm::inductance_q_h>(
        "machine.inductance_q_h", "H", 1e-9, 1e3, kRequired,
        "L_q across the magnet, two-phase equivalent; of a round rotor as L_d", {1e-7, 0.5}),
    machine_row<Pm, &Pm::torque_constant_nm_per_a>(
        "machine.torque_constant_nm_per_a", "N*m/A", 0, 1e6, kLive | kRequired,
        "K_m, two-phase equivalent: torque over current and peak voltage over speed of the shaft", {0, 200}),
    machine_row<Pm, &Pm::detent_torque_nm>("machine.detent_torque_nm", "N*m", 0, 1e6, kLive,
                                           "amplitude of the torque without current, -T_d sin(4 n_p theta)",
                                           {0, 1e3}),
    machine_row<Pm, &Pm::star>("machine.star", "1", 0, 1, kInteger,
                               "1: three phases in an isolated star, 0: two phases"),
});

/// The rules between the values.
void add_broken_pm_rules(const Pm& p, Problems& found) {
  if (p.torque_constant_nm_per_a == 0.0 && p.inductance_d_h == p.inductance_q_h) {
    found.add("machine.torque_constant_nm_per_a", [&] {
      return "is 0 but must be above 0 in a machine whose inductance_q_h equals inductance_d_h = " +
             text(p.inductance_d_h) + ": no current gives it a torque";
    });
  }
}

}  // namespace

MachineKind PmMachine::kind() noexcept {
  return {.name = "pm_synchronous",
          .rows = kPmTable,
          .add_broken_rules = rules_of<add_broken_pm_rules>,
          .make_train = make_drive_train<PmMachine>};
}

}  // namespace drivebench
