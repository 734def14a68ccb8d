#pragma once

#include <memory>
#include <span>
#include <string_view>
#include <variant>

#include "plant/machines/machines.hpp"
#include "plant/parameters/parameters.hpp"
#include "plant/problem.hpp"
#include "plant/windings.hpp"

namespace drivebench {

class Train;

/// The description of a kind of machine beside its equations. Each machine states it in its folder, in
/// <kind>_kind.cpp.
struct MachineKind {
  std::string_view name;  ///< machine.kind of configurations
  FieldSupply field = FieldSupply::kNone;
  std::span<const Parameter> rows;  ///< section [axis.machine]
  std::span<const CurveParameter> curves{};
  /// Appends the rules between the values that are broken; null: there are no such rules.
  void (*add_broken_rules)(const MachineParameters& machine, Problems& found) = nullptr;
  std::unique_ptr<Train> (*make_train)(const MachineParameters& machine, bool two_masses);
};

/// The kinds in the order of MachineParameters.
std::span<const MachineKind> all_machine_kinds() noexcept;

const MachineKind& kind_of(const MachineParameters& machine) noexcept;

/// Appends what is wrong between the values.
void add_problems(const MachineParameters& machine, Problems& found);

namespace machine_kind_detail {

template <class Machine>
Machine parameters_in(void (*)(const Machine&, Problems&));

}  // namespace machine_kind_detail

/// MachineKind::add_broken_rules from a function that takes the parameters of the kind.
template <auto kRules>
void rules_of(const MachineParameters& machine, Problems& found) {
  using Machine = decltype(machine_kind_detail::parameters_in(kRules));
  kRules(*std::get_if<Machine>(&machine), found);
}

}  // namespace drivebench
