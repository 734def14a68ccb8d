#include "plant/thermal.hpp"

#include "plant/math/first_order.hpp"

namespace drivebench {

void advance(const ThermalParameters& p, ThermalState& state, double loss_j, double period_s) noexcept {
  const FirstOrderStep step = first_order_step(period_s / p.time_constant_s);
  const double settled_k = p.ambient_k + p.resistance_k_per_w * (loss_j / period_s);
  state.temperature_k = lagged(step, state.temperature_k, settled_k, settled_k);
}

Adjustment thermal_adjustment(const ThermalParameters& p, const ThermalState& state) noexcept {
  if (!p.enabled) return {};
  const double rise_k = state.temperature_k - p.reference_k;
  return {.stator_resistance_factor = 1.0 + p.stator_coefficient_per_k * rise_k,
          .rotor_resistance_factor = 1.0 + p.rotor_coefficient_per_k * rise_k};
}

}  // namespace drivebench
