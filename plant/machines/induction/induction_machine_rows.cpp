#include "plant/machines/induction/induction_machine_rows.hpp"

#include <array>

#include "plant/parameters/rows.hpp"

namespace drivebench {
namespace {

using Machine = InductionMachineParameters;

constexpr auto kTable = std::to_array<Parameter>({
    machine_row<Machine, &Machine::pole_pairs>("machine.pole_pairs", "1", 1, 1000, kInteger | kRequired,
                                               "n_p"),
    machine_row<Machine, &Machine::stator_resistance_ohm>("machine.stator_resistance_ohm", "ohm", 1e-6, 1e6,
                                                          kLive | kRequired, "R_S, two-phase equivalent"),
    machine_row<Machine, &Machine::rotor_resistance_ohm>("machine.rotor_resistance_ohm", "ohm", 1e-6, 1e6,
                                                         kLive | kRequired, "R_R, two-phase equivalent"),
    machine_row<Machine, &Machine::stator_inductance_h>("machine.stator_inductance_h", "H", 1e-9, 1e3,
                                                        kRequired, "L_S"),
    machine_row<Machine, &Machine::rotor_inductance_h>("machine.rotor_inductance_h", "H", 1e-9, 1e3,
                                                       kRequired, "L_R"),
    machine_row<Machine, &Machine::mutual_inductance_h>("machine.mutual_inductance_h", "H", 1e-9, 1e3,
                                                        kRequired, "M"),
    machine_row<Machine, &Machine::star>("machine.star", "1", 0, 1, kInteger,
                                         "1: three phases in an isolated star, 0: two phases"),
});

}  // namespace

std::span<const Parameter> induction_machine_rows() noexcept {
  return kTable;
}

void add_problems(const InductionMachineParameters& p, Problems& found) {
  const bool has_inductances = p.rotor_inductance_h > 0.0 && p.stator_inductance_h > 0.0;
  if (const double sigma = has_inductances ? leakage_factor(p) : 1.0; !(sigma > 0.0)) {
    found.add("machine.mutual_inductance_h", [&] {
      return "makes the leakage factor sigma = 1 - M^2/(L_R L_S) = " + text(sigma) +
             " but it must be above 0";
    });
  }
}

}  // namespace drivebench
