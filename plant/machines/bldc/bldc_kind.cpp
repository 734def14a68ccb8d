#include "plant/machines/bldc/bldc_machine.hpp"

#include <array>

#include "plant/parameters/machine_kind.hpp"
#include "plant/parameters/rows.hpp"
#include "plant/train/drive_train_impl.hpp"

namespace drivebench {
namespace {

using Bldc = BldcMachineParameters;

constexpr auto kBldcTable = std::to_array<Parameter>({
    machine_row<Bldc, &Bldc::pole_pairs>("machine.pole_pairs", "1", 1, 1000, kInteger | kRequired, "n_p",
                                         {1, 200}),
    machine_row<Bldc, &Bldc::stator_resistance_ohm>("machine.stator_resistance_ohm", "ohm", 1e-6, 1e6,
                                                    kLive | kRequired, "R_S of a phase", {1e-4, 500}),
    machine_row<Bldc, &Bldc::self_inductance_h>("machine.self_inductance_h", "H", 1e-9, 1e3, kRequired,
                                                "L_S of a phase", {1e-7, 0.5}),
    machine_row<Bldc, &Bldc::mutual_inductance_h>(
        "machine.mutual_inductance_h", "H", 0, 1e3, kRequired,
        "M: a phase links the flux -M i of another; below half of self_inductance_h", {0, 0.5}),
    machine_row<Bldc, &Bldc::torque_constant_nm_per_a>(
        "machine.torque_constant_nm_per_a", "N*m/A", 1e-9, 1e6, kLive | kRequired,
        "tau_p = e_p at the flat top: torque over current of a phase, and its emf over speed of the shaft",
        {0, 200}),
    machine_row<Bldc, &Bldc::star>("machine.star", "1", 0, 1, kInteger,
                                   "1: an isolated star, 0: three independent phases"),
});

/// The rules between the values.
void add_broken_bldc_rules(const Bldc& p, Problems& found) {
  if (!(2.0 * p.mutual_inductance_h < p.self_inductance_h)) {
    found.add("machine.mutual_inductance_h", [&] {
      return "is " + text(p.mutual_inductance_h) +
             " but must be below half of self_inductance_h = " + text(p.self_inductance_h);
    });
  }
}

}  // namespace

MachineKind BldcMachine::kind() noexcept {
  return {.name = "bldc",
          .rows = kBldcTable,
          .add_broken_rules = rules_of<add_broken_bldc_rules>,
          .make_train = make_drive_train<BldcMachine>};
}

}  // namespace drivebench
