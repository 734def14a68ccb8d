#pragma once

#include <cstddef>

namespace drivebench::identification {

/// One classical Runge-Kutta step of length h. `slope(x, part)` is the derivative at the state x, `part` of
/// the step after its beginning: 0, 1/2 or 1.
template <class State, class Slope>
State runge_kutta(const State& x, double h, const Slope& slope) {
  const auto moved = [&x](double factor, const State& by) {
    State y = x;
    for (std::size_t k = 0; k < y.size(); ++k)
      y[k] += factor * by[k];
    return y;
  };
  const State k1 = slope(x, 0.0);
  const State k2 = slope(moved(0.5 * h, k1), 0.5);
  const State k3 = slope(moved(0.5 * h, k2), 0.5);
  const State k4 = slope(moved(h, k3), 1.0);
  State y = x;
  for (std::size_t k = 0; k < y.size(); ++k)
    y[k] += h / 6.0 * (k1[k] + 2.0 * k2[k] + 2.0 * k3[k] + k4[k]);
  return y;
}

}  // namespace drivebench::identification
