#include "clients/control/math/pole_placement.hpp"

#include <cmath>
#include <utility>
#include <vector>

namespace drivebench::control {

bool is_hurwitz(std::span<const double> coefficients) {
  const std::size_t width = coefficients.size() / 2 + 2;
  std::vector<double> above(width);
  std::vector<double> row(width);
  above[0] = 1.0;
  for (std::size_t k = 0; k < coefficients.size(); ++k)
    (k % 2 == 0 ? row[k / 2] : above[k / 2 + 1]) = coefficients[k];
  for (std::size_t n = 0; n < coefficients.size(); ++n) {
    if (!(row[0] > 0.0)) return false;
    std::vector<double> below(width);
    for (std::size_t k = 0; k + 1 < width; ++k)
      below[k] = above[k + 1] - above[0] * row[k + 1] / row[0];
    above = std::exchange(row, below);
  }
  return true;
}

bool is_schur(std::span<const double> coefficients) {
  std::vector<double> a(coefficients.begin(), coefficients.end());
  while (!a.empty()) {
    const double reflection = a.back();
    if (!(std::abs(reflection) < 1.0)) return false;
    a.pop_back();
    const std::vector<double> reversed(a.rbegin(), a.rend());
    for (std::size_t k = 0; k < a.size(); ++k)
      a[k] = (a[k] - reflection * reversed[k]) / (1.0 - reflection * reflection);
  }
  return true;
}

}  // namespace drivebench::control
