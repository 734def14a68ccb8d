#include "clients/identification/math/real_roots.hpp"

#include <algorithm>
#include <boost/multiprecision/cpp_bin_float.hpp>
#include <cmath>
#include <utility>

namespace drivebench::identification {
namespace {

using Coefficients = std::vector<Whole>;
using Real = boost::multiprecision::number<
    boost::multiprecision::cpp_bin_float<600, boost::multiprecision::digit_base_2>,
    boost::multiprecision::et_off>;

constexpr int kDeepest = 200;

int bits_of(const Whole& x) {
  return x == 0 ? 0 : static_cast<int>(msb(abs(x))) + 1;
}

/// p(x + 1).
void shift_by_one(Coefficients& p) {
  for (std::size_t i = 0; i + 1 < p.size(); ++i) {
    for (std::size_t k = p.size() - 1; k-- > i;)
      p[k] += p[k + 1];
  }
}

int variations(const Coefficients& p) {
  int count = 0;
  int last = 0;
  for (const Whole& x : p) {
    const int sign = x.sign();
    if (sign != 0 && last != 0 && sign != last) ++count;
    if (sign != 0) last = sign;
  }
  return count;
}

/// An upper bound of the number of roots in (0, 1), of the same parity; 0 and 1 are exact.
int count_in_unit(Coefficients p) {
  std::reverse(p.begin(), p.end());
  shift_by_one(p);
  return variations(p);
}

/// 2^n p(x/2).
void stretch(Coefficients& p) {
  for (std::size_t i = 0; i < p.size(); ++i)
    p[i] <<= p.size() - 1 - i;
}

/// b with every positive root below 2^b: twice the largest k-th root of -a_(n-k)/a_n.
int bound_exponent(const Coefficients& p) {
  const int lead_sign = p.back().sign();
  const int lead_bits = bits_of(p.back());
  int exponent = -4000;
  for (std::size_t k = 1; k < p.size(); ++k) {
    const Whole& x = p[p.size() - 1 - k];
    if (x.sign() * lead_sign >= 0) continue;
    const double share = (bits_of(x) - lead_bits + 1) / static_cast<double>(k);
    exponent = std::max(exponent, static_cast<int>(std::ceil(share)) + 1);
  }
  return exponent;
}

/// p(2^b x), times a power of two.
Coefficients scaled(Coefficients p, int b) {
  const std::size_t n = p.size() - 1;
  for (std::size_t i = 0; i <= n; ++i) {
    if (b >= 0) {
      p[i] <<= static_cast<std::size_t>(b) * i;
    } else {
      p[i] <<= static_cast<std::size_t>(-b) * (n - i);
    }
  }
  return p;
}

Real at(const std::vector<Real>& p, const Real& x) {
  Real sum = 0;
  for (std::size_t i = p.size(); i-- > 0;)
    sum = sum * x + p[i];
  return sum;
}

/// Halves an interval (of x/2^b) with one simple root until double precision is reached.
PositiveRoot refined(const std::vector<Real>& p, Real low, Real high, int b) {
  using boost::multiprecision::ldexp;
  // An end may be a root of the neighbouring interval: the sign is taken at the first midpoint.
  PositiveRoot root{};
  root.low = static_cast<double>(ldexp(low, b));
  root.high = static_cast<double>(ldexp(high, b));
  const Real inside = low + (high - low) / 1048576;
  int sign_low = at(p, low).sign();
  if (sign_low == 0) sign_low = at(p, inside).sign();
  while (high - low > ldexp(high, -56)) {
    const Real middle = (low + high) / 2;
    if (at(p, middle).sign() == sign_low) {
      low = middle;
    } else {
      high = middle;
    }
  }
  root.value = static_cast<double>(ldexp((low + high) / 2, b));
  root.falling = sign_low > 0;
  return root;
}

/// Part `at`/2^depth .. of the unit interval, with p carried to it.
struct Part {
  Coefficients p;
  Whole at;
  int depth;
};

}  // namespace

PositiveRoots positive_roots(const WholePolynomial& polynomial) {
  PositiveRoots found;
  Coefficients c = polynomial.coefficients();
  const auto first = std::find_if(c.begin(), c.end(), [](const Whole& x) { return x != 0; });
  c.erase(c.begin(), first);
  if (c.size() < 2 || variations(c) == 0) {
    found.complete = !polynomial.is_zero();
    return found;
  }
  const int b = bound_exponent(c);
  c = scaled(std::move(c), b);
  const std::vector<Real> real(c.begin(), c.end());
  std::vector<Part> open;
  open.push_back({.p = c, .at = 0, .depth = 0});
  while (!open.empty()) {
    Part part = std::move(open.back());
    open.pop_back();
    const int count = count_in_unit(part.p);
    if (count == 0) continue;
    if (count == 1) {
      const Real low = ldexp(Real(part.at), -part.depth);
      found.roots.push_back(refined(real, low, low + ldexp(Real(1), -part.depth), b));
      continue;
    }
    if (part.depth == kDeepest) {
      found.complete = false;
      continue;
    }
    stretch(part.p);
    Part right = {.p = part.p, .at = 2 * part.at + 1, .depth = part.depth + 1};
    shift_by_one(right.p);
    if (right.p.front() == 0) {  // a root exactly in the middle
      const Real middle = ldexp(Real(right.at), -right.depth);
      const Real width = ldexp(Real(1), -right.depth - 64);
      found.roots.push_back(refined(real, middle - width, middle + width, b));
      right.p.erase(right.p.begin());
      if (right.p.front() == 0) found.complete = false;
    }
    part.at *= 2;
    ++part.depth;
    open.push_back(std::move(right));
    open.push_back(std::move(part));
  }
  std::sort(found.roots.begin(), found.roots.end(),
            [](const PositiveRoot& x, const PositiveRoot& y) { return x.value < y.value; });
  return found;
}

SquareMatrix<Whole> whole_entries(const Triangle& factor) {
  constexpr int kBits = 60;
  const std::size_t n = factor.size();
  std::vector<int> exponent(n, 0);
  for (std::size_t j = 0; j < n; ++j) {
    double largest = 0.0;
    for (std::size_t i = 0; i <= j; ++i)
      largest = std::max(largest, std::abs(factor(i, j)));
    if (largest > 0.0) exponent[j] = kBits - std::ilogb(largest);
  }
  const int finest = *std::max_element(exponent.begin(), exponent.end());
  SquareMatrix<Whole> entries(n, std::vector<Whole>(n, Whole(0)));
  for (std::size_t j = 0; j < n; ++j) {
    for (std::size_t i = 0; i <= j; ++i) {
      entries[i][j] = Whole(std::nearbyint(std::ldexp(factor(i, j), exponent[j])));
      entries[i][j] <<= finest - exponent[j];
    }
  }
  return entries;
}

}  // namespace drivebench::identification
