#include "clients/control/math/polynomial.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

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
  const auto degree = static_cast<double>(c.size() - 1);
  for (std::size_t i = 0; i < c.size(); ++i)
    scaled[i] = c[i] / c.back() * std::pow(scale, static_cast<double>(i) - degree);
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
  const double scale = std::pow(std::abs(c.front() / c.back()), 1.0 / static_cast<double>(degree));
  const std::vector<double> monic = scaled_to_one(c, scale);
  std::vector<Complex> z(degree);
  for (std::size_t i = 0; i < degree; ++i)
    z[i] = std::pow(Complex(0.4, 0.9), static_cast<double>(i));  // neither real nor on one circle
  for (int pass = 0; pass < 500; ++pass) {
    double moved = 0.0;
    for (std::size_t i = 0; i < degree; ++i) {
      Complex others = 1.0;
      for (std::size_t j = 0; j < degree; ++j)
        if (j != i) others *= z[i] - z[j];
      const Complex step = value_of(monic, z[i]) / others;
      z[i] -= step;
      moved = std::max(moved, std::abs(step) / std::abs(z[i]));
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
    if (std::abs(root.imag()) <= 1e-6 * std::abs(root)) found.push_back(root.real());
  }
  std::ranges::sort(found);
  return found;
}

}  // namespace drivebench::control
