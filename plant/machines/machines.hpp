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

/// Every kind of machine; the alternative is the kind.
using MachineParameters =
    std::variant<InductionMachineParameters, SaturatedInductionMachineParameters, PmMachineParameters,
                 BldcMachineParameters, WoundRotorMachineParameters, PmDcMachineParameters,
                 SeparateDcMachineParameters, ShuntDcMachineParameters, SeriesDcMachineParameters,
                 LinearDcMachineParameters>;

}  // namespace drivebench
