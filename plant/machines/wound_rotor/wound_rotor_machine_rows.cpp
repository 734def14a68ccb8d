#include "plant/machines/wound_rotor/wound_rotor_machine_rows.hpp"

#include <array>

#include "plant/parameters/rows.hpp"

namespace drivebench {
namespace {

using Machine = WoundRotorMachineParameters;

constexpr auto kTable = std::to_array<Parameter>({
    machine_row<Machine, &Machine::pole_pairs>("machine.pole_pairs", "1", 1, 1000, kInteger | kRequired,
                                               "n_p"),
    machine_row<Machine, &Machine::stator_resistance_ohm>("machine.stator_resistance_ohm", "ohm", 1e-6, 1e6,
                                                          kLive | kRequired, "R_S, two-phase equivalent"),
    machine_row<Machine, &Machine::field_resistance_ohm>("machine.field_resistance_ohm", "ohm", 1e-6, 1e6,
                                                         kLive | kRequired, "R_F at the field terminals"),
    machine_row<Machine, &Machine::stator_inductance_h>("machine.stator_inductance_h", "H", 1e-9, 1e3,
                                                        kRequired, "L_S, two-phase equivalent"),
    machine_row<Machine, &Machine::field_inductance_h>("machine.field_inductance_h", "H", 1e-9, 1e3,
                                                       kRequired, "L_F at the field terminals"),
    machine_row<Machine, &Machine::mutual_inductance_h>(
        "machine.mutual_inductance_h", "H", 1e-9, 1e3, kRequired,
        "M, largest flux of a winding of the two-phase equivalent over the field current"),
    machine_row<Machine, &Machine::star>("machine.star", "1", 0, 1, kInteger,
                                         "1: three phases in an isolated star, 0: two phases"),
});

}  // namespace

std::span<const Parameter> wound_rotor_machine_rows() noexcept {
  return kTable;
}

void add_problems(const WoundRotorMachineParameters& p, Problems& found) {
  if (!(p.stator_inductance_h > 0.0 && p.field_inductance_h > 0.0)) return;
  if (const double sigma = leakage_factor(p); !(sigma > 0.0)) {
    found.add("machine.mutual_inductance_h", [&] {
      return "makes the leakage factor sigma = 1 - M^2/(L_S L_F) = " + text(sigma) +
             " but it must be above 0";
    });
  }
}

}  // namespace drivebench
