#include "clients/identification/motors/induction/induction_search.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cstdlib>

#include "clients/identification/motors/induction/induction_polynomial.hpp"
#include "clients/identification/motors/induction/induction_regressor.hpp"

namespace drivebench::identification {
namespace {

constexpr std::size_t kRows = kInductionParameters + 1;
constexpr std::size_t kLast = kInductionParameters;  ///< the column of y in the factor

/// Column of the projected problem that a factor belongs to; the last one is what no unknown multiplies.
constexpr std::size_t column_of(InductionFactor factor) noexcept {
  switch (factor) {
    case InductionFactor::kK4:
      return 0;
    case InductionFactor::kK6:
      return 1;
    case InductionFactor::kK14:
      return 2;
    case InductionFactor::kOne:
      break;
  }
  return 3;
}

/// [c_4, c_6, c_14, x (y - ...)]: four columns of polynomials in x = K_8 with W K - y = c_4 K_4 + ... .
std::vector<std::array<WholePolynomial, 4>> columns_of(const Triangle& factor) {
  const auto entries = whole_entries(factor);
  std::vector<std::array<WholePolynomial, 4>> rows(kRows);
  for (std::size_t i = 0; i < kRows; ++i) {
    std::array<std::vector<Whole>, 4> c;
    c.fill(std::vector<Whole>(4, Whole(0)));
    for (std::size_t j = 0; j < kInductionParameters; ++j) {
      const auto [which, power] = kInductionMonomials[j];
      const std::size_t column = column_of(which);
      c[column][static_cast<std::size_t>(power) + (column == 3 ? 1U : 0U)] += entries[i][j];
    }
    c[3][1] -= entries[i][kLast];
    for (std::size_t k = 0; k < 4; ++k)
      rows[i][k] = WholePolynomial(c[k]);
  }
  return rows;
}

}  // namespace

WholePolynomial induction_polynomial(const Triangle& factor) {
  const auto rows = columns_of(factor);
  SquareMatrix<WholePolynomial> s(4, std::vector<WholePolynomial>(4));
  for (std::size_t a = 0; a < 4; ++a) {
    for (std::size_t b = a; b < 4; ++b) {
      WholePolynomial sum;
      for (const auto& row : rows)
        sum = sum + row[a] * row[b];
      s[a][b] = s[b][a] = sum;
    }
  }
  SquareMatrix<WholePolynomial> g(3, std::vector<WholePolynomial>(3));
  for (std::size_t a = 0; a < 3; ++a) {
    for (std::size_t b = 0; b < 3; ++b)
      g[a][b] = s[a][b];
  }
  const WholePolynomial det_s = determinant(s);
  const WholePolynomial det_g = determinant(g);
  const WholePolynomial x(std::vector<Whole>{Whole(0), Whole(1)});
  return x * (det_g * det_s.derivative() - det_s * det_g.derivative()) -
         WholePolynomial(Whole(2)) * det_s * det_g;
}

namespace {

using Vector = Eigen::Matrix<double, static_cast<int>(kRows), 1>;

Eigen::Index index(std::size_t n) {
  return static_cast<Eigen::Index>(n);
}

double whole_power(double base, int exponent) noexcept {
  double result = 1.0;
  for (int n = std::abs(exponent); n > 0; --n)
    result *= base;
  return exponent < 0 ? 1.0 / result : result;
}

/// d^m/dK_8^m of R times the monomials of one factor.
Vector column_at(const Triangle& factor, InductionFactor which, double k8, int derivative) {
  Vector sum = Vector::Zero();
  for (std::size_t j = 0; j < kInductionParameters; ++j) {
    const auto [of, power] = kInductionMonomials[j];
    if (of != which) continue;
    double value = 1.0;
    for (int m = 0; m < derivative; ++m)
      value *= power - m;
    if (value == 0.0) continue;
    value *= whole_power(k8, power - derivative);
    for (std::size_t i = 0; i <= j; ++i)
      sum(index(i)) += factor(i, j) * value;
  }
  return sum;
}

/// Signals of the error W K - y at a point: its value and derivatives by K_8, and the columns of the linear
/// unknowns.
struct ErrorAt {
  std::array<Vector, 3> column;
  std::array<Vector, 3> column_slope;
  Vector error;
  Vector slope;
  Vector bend;
};

Vector target(const Triangle& factor) {
  Vector y;
  for (std::size_t i = 0; i < kRows; ++i)
    y(index(i)) = factor(i, kLast);
  return y;
}

constexpr std::array<InductionFactor, 3> kLinear = {InductionFactor::kK4, InductionFactor::kK6,
                                                    InductionFactor::kK14};

ErrorAt error_at(const Triangle& factor, const std::array<double, 3>& linear, double k8) {
  ErrorAt e;
  e.error = column_at(factor, InductionFactor::kOne, k8, 0) - target(factor);
  e.slope = column_at(factor, InductionFactor::kOne, k8, 1);
  e.bend = column_at(factor, InductionFactor::kOne, k8, 2);
  for (std::size_t n = 0; n < 3; ++n) {
    e.column[n] = column_at(factor, kLinear[n], k8, 0);
    e.column_slope[n] = column_at(factor, kLinear[n], k8, 1);
    e.error += linear[n] * e.column[n];
    e.slope += linear[n] * e.column_slope[n];
    e.bend += linear[n] * column_at(factor, kLinear[n], k8, 2);
  }
  return e;
}

/// The best K_4, K_6, K_14 for this K_8.
std::array<double, 3> projected(const Triangle& factor, double k8) {
  Eigen::Matrix<double, static_cast<int>(kRows), 3> w;
  for (std::size_t n = 0; n < 3; ++n)
    w.col(index(n)) = column_at(factor, kLinear[n], k8, 0);
  const Eigen::Vector3d scale = w.colwise().norm().cwiseMax(1e-300).cwiseInverse();
  const Vector y = target(factor) - column_at(factor, InductionFactor::kOne, k8, 0);
  const Eigen::Vector3d k =
      scale.asDiagonal() * (w * scale.asDiagonal()).colPivHouseholderQr().solve(y).eval();
  return {k(0), k(1), k(2)};
}

InductionMinimum minimum_at(const Triangle& factor, double k8) {
  const std::array<double, 3> k = projected(factor, k8);
  const ErrorAt e = error_at(factor, k, k8);
  InductionMinimum m = {.k4 = k[0],
                        .k6 = k[1],
                        .k8 = k8,
                        .k14 = k[2],
                        .residual = e.error.squaredNorm(),
                        .hessian = {},
                        .physical = false};
  m.hessian.assign(4, std::vector<double>(4, 0.0));
  constexpr std::array<std::size_t, 3> kPlace = {0, 1, 3};  // of K_4, K_6, K_14 beside K_8
  for (std::size_t a = 0; a < 3; ++a) {
    for (std::size_t b = 0; b < 3; ++b)
      m.hessian[kPlace[a]][kPlace[b]] = 2.0 * e.column[a].dot(e.column[b]);
    const double mixed = 2.0 * (e.column[a].dot(e.slope) + e.column_slope[a].dot(e.error));
    m.hessian[kPlace[a]][2] = m.hessian[2][kPlace[a]] = mixed;
  }
  m.hessian[2][2] = 2.0 * (e.slope.squaredNorm() + e.bend.dot(e.error));
  m.physical = m.k4 > 0.0 && m.k6 > m.k4 && m.k14 > 0.0;  // K_6 > K_4: R_S > 0; K_4 > 0: 0 < sigma < 1
  return m;
}

}  // namespace

InductionSearch search_induction(const Triangle& factor) {
  const WholePolynomial numerator = induction_polynomial(factor);
  const PositiveRoots roots = positive_roots(numerator);
  InductionSearch found;
  found.complete = roots.complete;
  found.degree = numerator.degree();
  found.stationary_points = static_cast<int>(roots.roots.size());
  for (const PositiveRoot& root : roots.roots) {
    if (!root.falling) found.minima.push_back(minimum_at(factor, root.value));
  }
  return found;
}

double induction_error(const Triangle& factor, double k4, double k6, double k8, double k14) {
  return error_at(factor, {k4, k6, k14}, k8).error.squaredNorm();
}

}  // namespace drivebench::identification
