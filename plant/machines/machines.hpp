#pragma once

#include <variant>

#include "plant/machines/bldc/bldc_machine.hpp"
#include "plant/machines/induction/induction_machine.hpp"
#include "plant/machines/linear_dc/linear_dc_machine.hpp"
#include "plant/machines/pm/pm_machine.hpp"
#include "plant/machines/pm_dc/pm_dc_machine.hpp"
#include "plant/machines/saturated_induction/saturated_induction_machine.hpp"
#include "plant/machines/separate_dc/separate_dc_machine.hpp"
#include "plant/machines/series_dc/series_dc_machine.hpp"
#include "plant/machines/shunt_dc/shunt_dc_machine.hpp"
#include "plant/machines/wound_rotor/wound_rotor_machine.hpp"

namespace drivebench {

template <class... Machines>
struct MachineList {
  using Parameters = std::variant<typename Machines::Parameters...>;
};

/// Every kind of machine. A new one is a folder and a line here; see plant/README.md.
using AllMachines = MachineList<InductionMachine,           //
                                SaturatedInductionMachine,  //
                                PmMachine,                  //
                                BldcMachine,                //
                                WoundRotorMachine,          //
                                PmDcMachine,                //
                                SeparateDcMachine,          //
                                ShuntDcMachine,             //
                                SeriesDcMachine,            //
                                LinearDcMachine>;

/// The parameters of one machine; the alternative is the kind.
using MachineParameters = AllMachines::Parameters;

inline Connection connection_of(const MachineParameters& machine) noexcept {
  return std::visit([](const auto& p) { return connection_of(p); }, machine);
}

}  // namespace drivebench
