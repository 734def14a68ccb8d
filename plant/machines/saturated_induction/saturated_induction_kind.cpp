#include "plant/machines/saturated_induction/saturated_induction_machine.hpp"

#include <array>
#include <string>
#include <utility>

#include "plant/parameters/machine_kind.hpp"
#include "plant/parameters/rows.hpp"
#include "plant/train/drive_train_impl.hpp"

namespace drivebench {
namespace {

using SaturatedInduction = SaturatedInductionMachineParameters;

constexpr auto kSaturatedInductionTable = std::to_array<Parameter>({
    machine_row<SaturatedInduction, &SaturatedInduction::pole_pairs>("machine.pole_pairs", "1", 1, 1000,
                                                                     kInteger | kRequired, "n_p", {1, 40}),
    machine_row<SaturatedInduction, &SaturatedInduction::stator_resistance_ohm>(
        "machine.stator_resistance_ohm", "ohm", 1e-6, 1e6, kLive | kRequired, "R_S, two-phase equivalent",
        {1e-4, 500}),
    machine_row<SaturatedInduction, &SaturatedInduction::rotor_resistance_ohm>(
        "machine.rotor_resistance_ohm", "ohm", 1e-6, 1e6, kLive | kRequired, "R_R, two-phase equivalent",
        {1e-4, 500}),
    machine_row<SaturatedInduction, &SaturatedInduction::stator_leakage_h>(
        "machine.stator_leakage_h", "H", 1e-9, 1e3, kRequired, "l_s = L_S - M, two-phase equivalent",
        {1e-6, 0.3}),
    machine_row<SaturatedInduction, &SaturatedInduction::rotor_leakage_h>(
        "machine.rotor_leakage_h", "H", 1e-9, 1e3, kRequired, "l_r = L_R - M, two-phase equivalent",
        {1e-6, 0.3}),
    machine_row<SaturatedInduction, &SaturatedInduction::star>(
        "machine.star", "1", 0, 1, kInteger, "1: three phases in an isolated star, 0: two phases"),
});

constexpr auto kSaturatedInductionCurves = std::to_array<CurveParameter>({
    {.name = "machine.magnetising_curve",
     .x_unit = "A",
     .y_unit = "Wb",
     .required = true,
     .rising = true,
     .meaning = "magnetising flux over magnetising current, two-phase equivalent, from [0, 0] on",
     .get = [](const AxisParameters& p) noexcept -> const Curve& {
       return std::get_if<SaturatedInduction>(&p.machine)->magnetising_curve;
     },
     .set =
         [](AxisParameters& p, Curve curve) {
           std::get_if<SaturatedInduction>(&p.machine)->magnetising_curve = std::move(curve);
         }},
});

/// The rules between the values.
void add_broken_saturated_induction_rules(const SaturatedInduction& p, Problems& found) {
  constexpr std::string_view kField = "machine.magnetising_curve";
  if (p.magnetising_curve.empty()) {
    found.add(kField, "has no points but needs two or more");
    return;
  }
  if (const CurvePoint first = p.magnetising_curve.points().front(); first != CurvePoint{0.0, 0.0}) {
    found.add(kField, [&] {
      return "begins at [" + text(first.x) + ", " + text(first.y) + "] but must begin at [0, 0]";
    });
  }
}

}  // namespace

MachineKind SaturatedInductionMachine::kind() noexcept {
  return {.name = "saturated_induction",
          .rows = kSaturatedInductionTable,
          .curves = kSaturatedInductionCurves,
          .add_broken_rules = rules_of<add_broken_saturated_induction_rules>,
          .make_train = make_drive_train<SaturatedInductionMachine>};
}

}  // namespace drivebench
