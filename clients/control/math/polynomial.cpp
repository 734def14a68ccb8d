#include "clients/control/math/polynomial.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "plant/math/exponential.hpp"
#include "plant/math/phasor.hpp"

namespace drivebench::control {
namespace {

using Complex = std::complex<double>;

Complex value_of(std::span<const double> monic, Complex x) {
  Complex sum = 0.0;
  for (std::size_t i = monic.size(); i-- > 0;)
    sum = sum * x + monic[i];
  return sum;
}

/// Divided by the leading coefficient and with x = scale·z, where the product of all z has the magnitude 1.
std::vector<double> scaled_to_one(std::span<const double> c, double scale) {
  std::vector<double> scaled(c.begin(), c.end());
  double divisor = c.back();
  for (std::size_t i = c.size(); i-- > 0; divisor *= scale)
    scaled[i] = c[i] / divisor;
  return scaled;
}

}  // namespace

std::vector<Complex> roots(std::span<const double> coefficients) {
  std::size_t zeros = 0;  // roots at exactly 0 have no scale of their own
  while (zeros < coefficients.size() && coefficients[zeros] == 0.0)
    ++zeros;
  std::span<const double> c = coefficients.subspan(zeros);
  while (!c.empty() && c.back() == 0.0)
    c = c.first(c.size() - 1);
  std::vector<Complex> found(c.empty() ? 0 : zeros);
  if (c.size() < 2) return found;

  const std::size_t degree = c.size() - 1;
  const double scale = power(std::abs(c.front() / c.back()), 1.0 / static_cast<double>(degree));
  const std::vector<double> monic = scaled_to_one(c, scale);
  std::vector<Complex> z(degree, 1.0);
  for (std::size_t i = 1; i < degree; ++i)
    z[i] = z[i - 1] * Complex(0.4, 0.9);  // neither real nor on one circle
  for (int pass = 0; pass < 500; ++pass) {
    double moved = 0.0;
    for (std::size_t i = 0; i < degree; ++i) {
      Complex others = 1.0;
      for (std::size_t j = 0; j < degree; ++j)
        if (j != i) others *= z[i] - z[j];
      const Complex step = quotient(value_of(monic, z[i]), others);
      z[i] -= step;
      moved = std::max(moved, magnitude(step) / magnitude(z[i]));
    }
    if (moved < 1e-15) break;
  }
  for (const Complex& root : z)
    found.push_back(root * scale);
  return found;
}

std::vector<double> real_roots(std::span<const double> coefficients) {
  std::vector<double> found;
  for (const Complex& root : roots(coefficients)) {
    if (std::abs(root.imag()) <= 1e-6 * magnitude(root)) found.push_back(root.real());
  }
  std::ranges::sort(found);
  return found;
}

}  // namespace drivebench::control
