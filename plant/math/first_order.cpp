#include "plant/math/first_order.hpp"

#include "plant/math/exponential.hpp"

namespace drivebench {

/// For small a the differences from 1 cancel. There ramp/a = 1/2! - a/3! + a²/4! - ..., even and odd terms
/// apart for speed; the first omitted one is 4e-19 of the sum at a = 1/16.
FirstOrderStep first_order_step(double a) noexcept {
  constexpr double kSmall = 0.0625;
  if (a > kSmall) {
    const double change = 1.0 - exponential(-a);
    return {.change = change, .ramp = 1.0 - change / a};
  }
  const double z = a * a;
  const double even = 1.0 / 2.0 + z * (1.0 / 24.0 + z * (1.0 / 720.0 + z * (1.0 / 40320.0 + z / 3628800.0)));
  const double odd = 1.0 / 6.0 + z * (1.0 / 120.0 + z * (1.0 / 5040.0 + z / 362880.0));
  const double ramp = a * (even - a * odd);
  return {.change = a - a * ramp, .ramp = ramp};
}

}  // namespace drivebench
