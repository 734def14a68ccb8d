#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "clients/control/math/pole_placement.hpp"

namespace drivebench::control {

/// A matrix of a few rows, by rows.
template <std::size_t R, std::size_t C>
using Matrix = std::array<std::array<double, C>, R>;

template <std::size_t N>
constexpr Matrix<N, N> scaled_identity(double x) noexcept {
  Matrix<N, N> result{};
  for (std::size_t i = 0; i < N; ++i)
    result[i][i] = x;
  return result;
}

/// a + scale·b
template <std::size_t R, std::size_t C>
constexpr Matrix<R, C> sum(const Matrix<R, C>& a, const Matrix<R, C>& b, double scale = 1.0) noexcept {
  Matrix<R, C> result = a;
  for (std::size_t i = 0; i < R; ++i) {
    for (std::size_t j = 0; j < C; ++j)
      result[i][j] += scale * b[i][j];
  }
  return result;
}

template <std::size_t R, std::size_t K, std::size_t C>
constexpr Matrix<R, C> product(const Matrix<R, K>& a, const Matrix<K, C>& b) noexcept {
  Matrix<R, C> result{};
  for (std::size_t i = 0; i < R; ++i) {
    for (std::size_t j = 0; j < C; ++j) {
      for (std::size_t k = 0; k < K; ++k)
        result[i][j] += a[i][k] * b[k][j];
    }
  }
  return result;
}

template <std::size_t R, std::size_t C>
constexpr Matrix<R, C> scaled(const Matrix<R, C>& a, double scale) noexcept {
  return sum(Matrix<R, C>{}, a, scale);
}

/// a⁻¹·b by Gauss-Jordan elimination with pivoting; not finite if a is singular.
template <std::size_t N, std::size_t C>
Matrix<N, C> solved(Matrix<N, N> a, Matrix<N, C> b) noexcept {
  for (std::size_t column = 0; column < N; ++column) {
    std::size_t pivot = column;
    for (std::size_t row = column + 1; row < N; ++row) {
      if (std::abs(a[row][column]) > std::abs(a[pivot][column])) pivot = row;
    }
    std::swap(a[pivot], a[column]);
    std::swap(b[pivot], b[column]);
    if (a[column][column] == 0.0) {
      for (auto& row : b)
        row.fill(std::numeric_limits<double>::quiet_NaN());
      return b;
    }
    for (std::size_t row = 0; row < N; ++row) {
      if (row == column) continue;
      const double factor = a[row][column] / a[column][column];
      for (std::size_t k = 0; k < N; ++k)
        a[row][k] -= factor * a[column][k];
      for (std::size_t k = 0; k < C; ++k)
        b[row][k] -= factor * b[column][k];
    }
  }
  for (std::size_t row = 0; row < N; ++row) {
    for (double& x : b[row])
      x /= a[row][row];
  }
  return b;
}

/// e^a: the Taylor series of a/2^k, squared k times.
template <std::size_t N>
Matrix<N, N> matrix_exponential(const Matrix<N, N>& a) noexcept {
  double norm = 0.0;
  for (const auto& row : a) {
    for (const double x : row)
      norm = std::max(norm, std::abs(x));
  }
  int squarings = 0;
  for (; norm > 0.1; norm *= 0.5)
    ++squarings;
  const Matrix<N, N> small = scaled(a, std::ldexp(1.0, -squarings));
  Matrix<N, N> term = scaled_identity<N>(1.0);
  Matrix<N, N> result = term;
  constexpr int kTerms = 14;  // (0.1 N)^14/14! is below the rounding
  for (int k = 1; k <= kTerms; ++k) {
    term = scaled(product(term, small), 1.0 / k);
    result = sum(result, term);
  }
  for (; squarings > 0; --squarings)
    result = product(result, result);
  return result;
}

/// det(s·1 − a), by Faddeev and LeVerrier.
template <std::size_t N>
constexpr Polynomial<N> characteristic_polynomial(const Matrix<N, N>& a) noexcept {
  Polynomial<N> c{};
  Matrix<N, N> m = scaled_identity<N>(1.0);
  for (std::size_t n = 0; n < N; ++n) {
    m = product(a, m);
    double trace = 0.0;
    for (std::size_t i = 0; i < N; ++i)
      trace += m[i][i];
    c[n] = -trace / static_cast<double>(n + 1);
    m = sum(m, scaled_identity<N>(c[n]));
  }
  return c;
}

}  // namespace drivebench::control
