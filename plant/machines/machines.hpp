#pragma once

#include <variant>

#include "plant/machines/bldc_machine.hpp"
#include "plant/machines/induction_machine.hpp"
#include "plant/machines/linear_dc_machine.hpp"
#include "plant/machines/pm_dc_machine.hpp"
#include "plant/machines/pm_machine.hpp"
#include "plant/machines/saturated_induction_machine.hpp"
#include "plant/machines/separate_dc_machine.hpp"
#include "plant/machines/series_dc_machine.hpp"
#include "plant/machines/shunt_dc_machine.hpp"
#include "plant/machines/wound_rotor_machine.hpp"

namespace drivebench {

/// Every kind of machine; the alternative is the kind.
using MachineParameters =
    std::variant<InductionMachineParameters, SaturatedInductionMachineParameters, PmMachineParameters,
                 BldcMachineParameters, WoundRotorMachineParameters, PmDcMachineParameters,
                 SeparateDcMachineParameters, ShuntDcMachineParameters, SeriesDcMachineParameters,
                 LinearDcMachineParameters>;

}  // namespace drivebench
