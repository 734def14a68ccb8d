#pragma once

#include <cmath>
#include <complex>
#include <numbers>
#include <span>

#include "plant/math/phasor.hpp"
#include "plant/math/trig.hpp"

/// Distribution of a winding around the air gap: by which factor its field is smaller than that of as many
/// turns in one place. Angles are electrical; `harmonic` is 1 for the fundamental. Source: the book, 7.4.1
/// (GEN-01).
namespace drivebench {

/// Loops of equal turns at these angles [rad]: |Σ e^(jνα)|/n.
inline double distribution_factor(std::span<const double> angles_rad, int harmonic) noexcept {
  std::complex<double> sum = 0.0;
  for (const double angle : angles_rad)
    sum += phasor(harmonic * angle);
  return magnitude(sum) / static_cast<double>(angles_rad.size());
}

/// A coil that spans `pitch` of a pole: sin(νπ·pitch/2), negative where the harmonic turns over.
inline double pitch_factor(double pitch, int harmonic) noexcept {
  return sine(harmonic * 0.5 * std::numbers::pi * pitch);
}

/// Endlessly many loops, spread evenly over the belt π/m of one of m phases: sin(νπ/2m)/(νπ/2m).
inline double even_distribution_factor(int phases, int harmonic) noexcept {
  const double half_belt_rad = harmonic * 0.5 * std::numbers::pi / phases;
  return std::abs(sine(half_belt_rad) / half_belt_rad);
}

}  // namespace drivebench
