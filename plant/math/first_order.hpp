#pragma once

namespace drivebench {

/// One step of a first-order lag, T y' = x - y, while its input goes linearly from x0 to x1. Exact:
///   y1 = y0 + change (x0 - y0) + ramp (x1 - x0)
/// A lag that has settled on a constant input stays on it to the last bit.
struct FirstOrderStep {
  double change = 0.0;  ///< 1 - exp(-a), a = step/T
  double ramp = 0.0;    ///< 1 - (1 - exp(-a))/a
};

/// The coefficients for a = step/T >= 0, relative errors below 2e-15 and 6e-14.
FirstOrderStep first_order_step(double step_over_time_constant) noexcept;

constexpr double lagged(FirstOrderStep step, double y, double from, double to) noexcept {
  return y + (step.change * (from - y) + step.ramp * (to - from));
}

}  // namespace drivebench
