#include "plant/machines/induction/induction_machine.hpp"

#include <array>

#include "plant/parameters/machine_kind.hpp"
#include "plant/parameters/rows.hpp"
#include "plant/train/drive_train_impl.hpp"

namespace drivebench {
namespace {

using Induction = InductionMachineParameters;

constexpr auto kInductionTable = std::to_array<Parameter>({
    machine_row<Induction, &Induction::pole_pairs>("machine.pole_pairs", "1", 1, 1000, kInteger | kRequired,
                                                   "n_p", {1, 40}),
    machine_row<Induction, &Induction::stator_resistance_ohm>("machine.stator_resistance_ohm", "ohm", 1e-6,
                                                              1e6, kLive | kRequired,
                                                              "R_S, two-phase equivalent", {1e-4, 500}),
    machine_row<Induction, &Induction::rotor_resistance_ohm>("machine.rotor_resistance_ohm", "ohm", 1e-6, 1e6,
                                                             kLive | kRequired, "R_R, two-phase equivalent",
                                                             {1e-4, 500}),
    machine_row<Induction, &Induction::stator_inductance_h>("machine.stator_inductance_h", "H", 1e-9, 1e3,
                                                            kRequired, "L_S", {1e-4, 3}),
    machine_row<Induction, &Induction::rotor_inductance_h>("machine.rotor_inductance_h", "H", 1e-9, 1e3,
                                                           kRequired, "L_R", {1e-4, 3}),
    machine_row<Induction, &Induction::mutual_inductance_h>("machine.mutual_inductance_h", "H", 1e-9, 1e3,
                                                            kRequired, "M", {1e-4, 3}),
    machine_row<Induction, &Induction::star>("machine.star", "1", 0, 1, kInteger,
                                             "1: three phases in an isolated star, 0: two phases"),
});

/// The rules between the values.
void add_broken_induction_rules(const Induction& p, Problems& found) {
  const bool has_inductances = p.rotor_inductance_h > 0.0 && p.stator_inductance_h > 0.0;
  if (const double sigma = has_inductances ? leakage_factor(p) : 1.0; !(sigma > 0.0)) {
    found.add("machine.mutual_inductance_h", [&] {
      return "makes the leakage factor sigma = 1 - M^2/(L_R L_S) = " + text(sigma) +
             " but it must be above 0";
    });
  }
}

}  // namespace

MachineKind InductionMachine::kind() noexcept {
  return {.name = "induction",
          .rows = kInductionTable,
          .add_broken_rules = rules_of<add_broken_induction_rules>,
          .make_train = make_drive_train<InductionMachine>};
}

}  // namespace drivebench
