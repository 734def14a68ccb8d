#pragma once

#include "plant/windings.hpp"

namespace drivebench {

/// Section [axis.thermal]: one body of copper, heated by the losses of the machine. Resistances grow with its
/// temperature.
struct ThermalParameters {
  bool enabled = false;
  double resistance_k_per_w = 1.0;  ///< to the surroundings
  double time_constant_s = 600.0;
  double ambient_k = 293.15;
  double reference_k = 293.15;                ///< at which the resistances of the machine hold
  double stator_coefficient_per_k = 0.00393;  ///< copper
  double rotor_coefficient_per_k = 0.00403;   ///< aluminium cage
};

struct ThermalState {
  double temperature_k = 0.0;
};

/// One step of T_th θ' = ambient + R_th P - θ under the mean power P = loss_j/period_s. Exact.
void advance(const ThermalParameters& p, ThermalState& state, double loss_j, double period_s) noexcept;

/// The effect of the temperature on the resistances: factors 1 + coefficient (θ - reference); 1 if not
/// enabled.
Adjustment thermal_adjustment(const ThermalParameters& p, const ThermalState& state) noexcept;

}  // namespace drivebench
