#pragma once

#include <complex>

#include "plant/math/length.hpp"
#include "plant/math/unbounded.hpp"

/// Complex numbers with the same bits on every machine. Sums and products of std::complex are such; its polar
/// form, its magnitude and its quotient are left to libraries that differ.
namespace drivebench {

/// magnitude·e^(j·angle), for any angle.
inline std::complex<double> phasor(double angle_rad, double magnitude = 1.0) noexcept {
  const CosSin at = cos_sin_unbounded(angle_rad);
  return {magnitude * at.cos, magnitude * at.sin};
}

inline double magnitude(std::complex<double> z) noexcept {
  return length(z.real(), z.imag());
}

/// In [-pi, pi].
inline double argument(std::complex<double> z) noexcept {
  return arctangent2(z.imag(), z.real());
}

/// x/y = x·y*/|y|², for |y| between 1e-140 and 1e150.
inline std::complex<double> quotient(std::complex<double> x, std::complex<double> y) noexcept {
  const double square = y.real() * y.real() + y.imag() * y.imag();
  return {(x.real() * y.real() + x.imag() * y.imag()) / square,
          (x.imag() * y.real() - x.real() * y.imag()) / square};
}

}  // namespace drivebench
