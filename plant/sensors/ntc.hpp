#pragma once

#include <cstdint>

#include "plant/math/exponential.hpp"
#include "plant/math/rounding.hpp"

namespace drivebench {

/// A thermistor from the input of the converter to ground, under a resistor from the reference voltage; part
/// of section [axis.temperature_sensor].
struct NtcParameters {
  double ohm = 0.0;       ///< at 25 degrees Celsius; 0: the numbers of the converter are linear in kelvin
  double beta_k = 0.0;    ///< B: R = R_25 exp(B (1/T - 1/298.15 K))
  double pull_ohm = 0.0;  ///< to the reference voltage
};

/// The number of a converter of so many bits at the divider, R/(R + R_pull) of 2^bits, rounded down.
inline std::uint64_t ntc_count(const NtcParameters& p, double temperature_k, int bits) noexcept {
  constexpr double kColdestK = 1.0;  // a sensor with errors may say less than nothing
  constexpr double kNominalK = 298.15;
  const double t_k = temperature_k > kColdestK ? temperature_k : kColdestK;
  // R_pull/R, which stays finite where R does not.
  const double pull = p.pull_ohm / p.ohm * exponential(-p.beta_k * (1.0 / t_k - 1.0 / kNominalK));
  const double steps = static_cast<double>(std::int64_t{1} << bits);
  const double count = steps / (1.0 + pull);
  return static_cast<std::uint64_t>(count < steps ? floor_to_integer(count) : (std::int64_t{1} << bits) - 1);
}

}  // namespace drivebench
