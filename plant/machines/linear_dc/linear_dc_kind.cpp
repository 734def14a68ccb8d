#include "plant/machines/linear_dc/linear_dc_machine.hpp"

#include <array>

#include "plant/parameters/machine_kind.hpp"
#include "plant/parameters/rows.hpp"
#include "plant/train/drive_train_impl.hpp"

namespace drivebench {
namespace {

using LinearDc = LinearDcMachineParameters;

constexpr auto kLinearDcTable = std::to_array<Parameter>({
    machine_row<LinearDc, &LinearDc::resistance_ohm>("machine.resistance_ohm", "ohm", 1e-6, 1e6,
                                                     kLive | kRequired, "R of the loop of rails and bar",
                                                     {1e-4, 500}),
    machine_row<LinearDc, &LinearDc::inductance_h>("machine.inductance_h", "H", 1e-9, 1e3, kRequired,
                                                   "L of the loop; its limit 0 is the model of the book",
                                                   {1e-8, 3}),
    machine_row<LinearDc, &LinearDc::flux_density_t>("machine.flux_density_t", "T", -100, 100,
                                                     kLive | kRequired, "B across the rails", {-3, 3}),
    machine_row<LinearDc, &LinearDc::bar_length_m>("machine.bar_length_m", "m", 1e-6, 1e3, kRequired,
                                                   "l of the bar between the rails", {1e-3, 30}),
});

/// The rules between the values.
void add_broken_linear_dc_rules(const LinearDc& p, Problems& found) {
  if (p.flux_density_t == 0.0) found.add("machine.flux_density_t", "is 0 but must not be 0");
}

}  // namespace

MachineKind LinearDcMachine::kind() noexcept {
  return {.name = "linear_dc",
          .rows = kLinearDcTable,
          .add_broken_rules = rules_of<add_broken_linear_dc_rules>,
          .make_train = make_drive_train<LinearDcMachine>};
}

}  // namespace drivebench
