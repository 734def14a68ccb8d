#include "plant/machines/wound_rotor/wound_rotor_machine.hpp"

#include <array>

#include "plant/parameters/machine_kind.hpp"
#include "plant/parameters/rows.hpp"
#include "plant/train/drive_train_impl.hpp"

namespace drivebench {
namespace {

using WoundRotor = WoundRotorMachineParameters;

constexpr auto kWoundRotorTable = std::to_array<Parameter>({
    machine_row<WoundRotor, &WoundRotor::pole_pairs>("machine.pole_pairs", "1", 1, 1000, kInteger | kRequired,
                                                     "n_p", {1, 200}),
    machine_row<WoundRotor, &WoundRotor::stator_resistance_ohm>("machine.stator_resistance_ohm", "ohm", 1e-6,
                                                                1e6, kLive | kRequired,
                                                                "R_S, two-phase equivalent", {1e-4, 500}),
    machine_row<WoundRotor, &WoundRotor::field_resistance_ohm>("machine.field_resistance_ohm", "ohm", 1e-6,
                                                               1e6, kLive | kRequired,
                                                               "R_F at the field terminals", {1e-4, 1e4}),
    machine_row<WoundRotor, &WoundRotor::stator_inductance_h>(
        "machine.stator_inductance_h", "H", 1e-9, 1e3, kRequired, "L_S, two-phase equivalent", {1e-6, 3}),
    machine_row<WoundRotor, &WoundRotor::field_inductance_h>(
        "machine.field_inductance_h", "H", 1e-9, 1e3, kRequired, "L_F at the field terminals", {0, 500}),
    machine_row<WoundRotor, &WoundRotor::mutual_inductance_h>(
        "machine.mutual_inductance_h", "H", 1e-9, 1e3, kRequired,
        "M, largest flux of a winding of the two-phase equivalent over the field current", {1e-6, 50}),
    machine_row<WoundRotor, &WoundRotor::star>("machine.star", "1", 0, 1, kInteger,
                                               "1: three phases in an isolated star, 0: two phases"),
});

/// The rules between the values.
void add_broken_wound_rotor_rules(const WoundRotor& p, Problems& found) {
  if (!(p.stator_inductance_h > 0.0 && p.field_inductance_h > 0.0)) return;
  if (const double sigma = leakage_factor(p); !(sigma > 0.0)) {
    found.add("machine.mutual_inductance_h", [&] {
      return "makes the leakage factor sigma = 1 - M^2/(L_S L_F) = " + text(sigma) +
             " but it must be above 0";
    });
  }
}

}  // namespace

MachineKind WoundRotorMachine::kind() noexcept {
  return {.name = "wound_rotor_synchronous",
          .field = FieldSupply::kOwnTerminals,
          .rows = kWoundRotorTable,
          .add_broken_rules = rules_of<add_broken_wound_rotor_rules>,
          .make_train = make_drive_train<WoundRotorMachine>};
}

}  // namespace drivebench
