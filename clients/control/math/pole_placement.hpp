#pragma once

#include <array>
#include <cstddef>
#include <span>

namespace drivebench::control {

/// Coefficients of a monic polynomial after its leading 1, highest power first.
template <std::size_t N>
using Polynomial = std::array<double, N>;

/// (s + p_1)···(s + p_N): roots at −p_i, as the book gives poles.
template <std::size_t N>
constexpr Polynomial<N> placed_polynomial(const std::array<double, N>& p_per_s) noexcept {
  Polynomial<N> c{};
  for (std::size_t n = 0; n < N; ++n) {
    for (std::size_t k = n; k > 0; --k)
      c[k] += p_per_s[n] * c[k - 1];
    c[0] += p_per_s[n];
  }
  return c;
}

/// (s + r)(s² + 2ζω_n·s + ω_n²), the other choice of the book for three poles.
constexpr Polynomial<3> placed_polynomial(double r_per_s, double damping, double natural_rad_s) noexcept {
  const double first = 2.0 * damping * natural_rad_s;
  const double second = natural_rad_s * natural_rad_s;
  return {r_per_s + first, r_per_s * first + second, r_per_s * second};
}

/// Whether all roots have a negative real part: Routh's first column is positive.
bool is_hurwitz(std::span<const double> coefficients);

/// Whether all roots lie inside the unit circle: Jury's reflection coefficients are below one.
bool is_schur(std::span<const double> coefficients);

}  // namespace drivebench::control
