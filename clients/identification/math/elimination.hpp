#pragma once

#include <cstddef>
#include <utility>
#include <vector>

/// Elimination theory over any commutative ring: numbers, whole numbers, residues, polynomials of these.
/// Source: the book, appendix of chapter 8; tag ELIM-01.
namespace drivebench::identification {

/// A polynomial over a ring, ascending powers; the zero polynomial has no coefficients. Trailing zeros are
/// cut off, so the degree is the size less one.
template <class Ring>
class Polynomial {
 public:
  Polynomial() = default;
  Polynomial(int constant) : Polynomial(Ring(constant)) {}
  Polynomial(Ring constant) {
    if (!(constant == Ring(0))) c_.push_back(std::move(constant));
  }
  explicit Polynomial(std::vector<Ring> ascending) : c_(std::move(ascending)) { trim(); }

  const std::vector<Ring>& coefficients() const { return c_; }
  bool is_zero() const { return c_.empty(); }
  /// -1 of the zero polynomial.
  int degree() const { return static_cast<int>(c_.size()) - 1; }

  friend bool operator==(const Polynomial& x, const Polynomial& y) { return x.c_ == y.c_; }
  friend Polynomial operator+(Polynomial x, const Polynomial& y) { return x.add(y, false); }
  friend Polynomial operator-(Polynomial x, const Polynomial& y) { return x.add(y, true); }
  friend Polynomial operator-(const Polynomial& x) { return Polynomial() - x; }
  friend Polynomial operator*(const Polynomial& x, const Polynomial& y) {
    if (x.is_zero() || y.is_zero()) return {};
    std::vector<Ring> product(x.c_.size() + y.c_.size() - 1, Ring(0));
    for (std::size_t i = 0; i < x.c_.size(); ++i) {
      for (std::size_t j = 0; j < y.c_.size(); ++j)
        product[i + j] = product[i + j] + x.c_[i] * y.c_[j];
    }
    return Polynomial(std::move(product));
  }

  Polynomial derivative() const {
    std::vector<Ring> slope;
    for (std::size_t i = 1; i < c_.size(); ++i)
      slope.push_back(Ring(static_cast<int>(i)) * c_[i]);
    return Polynomial(std::move(slope));
  }

  /// The value where the variable is x, by Horner's rule.
  template <class Argument>
  Argument at(const Argument& x) const {
    Argument sum(0);
    for (std::size_t i = c_.size(); i-- > 0;)
      sum = sum * x + Argument(c_[i]);
    return sum;
  }

 private:
  Polynomial& add(const Polynomial& y, bool negative) {
    if (c_.size() < y.c_.size()) c_.resize(y.c_.size(), Ring(0));
    for (std::size_t i = 0; i < y.c_.size(); ++i)
      c_[i] = negative ? Ring(c_[i] - y.c_[i]) : Ring(c_[i] + y.c_[i]);
    trim();
    return *this;
  }
  void trim() {
    while (!c_.empty() && c_.back() == Ring(0))
      c_.pop_back();
  }

  std::vector<Ring> c_;
};

/// A square matrix, row by row.
template <class Ring>
using SquareMatrix = std::vector<std::vector<Ring>>;

/// The determinant without a division, from the characteristic polynomial of growing leading blocks
/// (Samuelson, Berkowitz): the ring need not have quotients. n^4 operations.
template <class Ring>
Ring determinant(const SquareMatrix<Ring>& m) {
  std::vector<Ring> characteristic = {Ring(1)};  // of the leading block, highest power first
  for (std::size_t n = 0; n < m.size(); ++n) {
    // First column of the Toeplitz matrix: 1, -m_nn, -r c, -r A c, -r A^2 c, ... with the block A.
    std::vector<Ring> column = {Ring(1), Ring(0) - m[n][n]};
    std::vector<Ring> power(n, Ring(0));
    for (std::size_t i = 0; i < n; ++i)
      power[i] = m[i][n];
    for (std::size_t k = 0; k < n; ++k) {
      Ring sum(0);
      for (std::size_t i = 0; i < n; ++i)
        sum = sum + m[n][i] * power[i];
      column.push_back(Ring(0) - sum);
      std::vector<Ring> next(n, Ring(0));
      for (std::size_t i = 0; i < n; ++i) {
        for (std::size_t j = 0; j < n; ++j)
          next[i] = next[i] + m[i][j] * power[j];
      }
      power = std::move(next);
    }
    std::vector<Ring> grown(n + 2, Ring(0));
    for (std::size_t i = 0; i < grown.size(); ++i) {
      for (std::size_t j = 0; j <= i && j < characteristic.size(); ++j)
        grown[i] = grown[i] + column[i - j] * characteristic[j];
    }
    characteristic = std::move(grown);
  }
  return m.size() % 2 == 0 ? characteristic.back() : Ring(0) - characteristic.back();
}

/// Sylvester's matrix of two polynomials, one of them at least of degree 1. Its determinant is zero where
/// they have a common zero, or where both leading coefficients vanish: the converse needs one that does not.
template <class Ring>
SquareMatrix<Ring> sylvester(const Polynomial<Ring>& a, const Polynomial<Ring>& b) {
  const auto da = static_cast<std::size_t>(a.degree());
  const auto db = static_cast<std::size_t>(b.degree());
  SquareMatrix<Ring> m(da + db, std::vector<Ring>(da + db, Ring(0)));
  for (std::size_t row = 0; row < db; ++row) {
    for (std::size_t i = 0; i <= da; ++i)
      m[row][row + da - i] = a.coefficients()[i];
  }
  for (std::size_t row = 0; row < da; ++row) {
    for (std::size_t i = 0; i <= db; ++i)
      m[db + row][row + db - i] = b.coefficients()[i];
  }
  return m;
}

/// det of Sylvester's matrix: the polynomial in the other variables on which a and b may have common zeros.
/// Zero if either polynomial is.
template <class Ring>
Ring resultant(const Polynomial<Ring>& a, const Polynomial<Ring>& b) {
  if (a.is_zero() || b.is_zero()) return Ring(0);
  return determinant(sylvester(a, b));
}

}  // namespace drivebench::identification
