#include "plant/machines/linear_dc/linear_dc_machine_rows.hpp"

#include <array>

#include "plant/parameters/rows.hpp"

namespace drivebench {
namespace {

using Machine = LinearDcMachineParameters;

constexpr auto kTable = std::to_array<Parameter>({
    machine_row<Machine, &Machine::resistance_ohm>("machine.resistance_ohm", "ohm", 1e-6, 1e6,
                                                   kLive | kRequired, "R of the loop of rails and bar"),
    machine_row<Machine, &Machine::inductance_h>("machine.inductance_h", "H", 1e-9, 1e3, kRequired,
                                                 "L of the loop; its limit 0 is the model of the book"),
    machine_row<Machine, &Machine::flux_density_t>("machine.flux_density_t", "T", -100, 100,
                                                   kLive | kRequired, "B across the rails"),
    machine_row<Machine, &Machine::bar_length_m>("machine.bar_length_m", "m", 1e-6, 1e3, kRequired,
                                                 "l of the bar between the rails"),
});

}  // namespace

std::span<const Parameter> linear_dc_machine_rows() noexcept {
  return kTable;
}

void add_problems(const LinearDcMachineParameters& p, Problems& found) {
  if (p.flux_density_t == 0.0) found.add("machine.flux_density_t", "is 0 but must not be 0");
}

}  // namespace drivebench
