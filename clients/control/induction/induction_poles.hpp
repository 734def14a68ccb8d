#pragma once

#include <complex>
#include <vector>

#include "clients/control/induction/field_oriented_controller.hpp"
#include "clients/models/induction_machine.hpp"

// The poles that the gains of a field-oriented or linearised induction machine give, each loop alone and
// without sampling. Source: the book, exercise 14 of chapter 8.
namespace drivebench::control {

/// s³ + K2·s² + K1·s + K0: angle, its friction compensated.
std::vector<std::complex<double>> mechanical_poles(const ServoGains& gains);

/// s² + (η + η·M·K_ψP)·s + η·M·K_ψI
std::vector<std::complex<double>> flux_poles(const InductionMachineModel& machine, const FluxGains& gains);

/// s² + (γ + K_P/(σ·L_S))·s + K_I/(σ·L_S): either current, without what couples it to the other and to the
/// flux. A loop whose slow pole is far below the other passes on only K_P/(K_P + σ·L_S·γ) of a quick
/// reference.
std::vector<std::complex<double>> current_poles(const InductionMotorModel& motor, const CurrentGains& gains);

}  // namespace drivebench::control
