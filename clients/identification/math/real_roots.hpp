#pragma once

#include <boost/multiprecision/cpp_int.hpp>
#include <vector>

#include "clients/identification/math/elimination.hpp"
#include "clients/identification/math/least_squares.hpp"

namespace drivebench::identification {

/// Unlimited integers for exact arithmetic.
using Whole = boost::multiprecision::cpp_int;
using WholePolynomial = Polynomial<Whole>;

/// A positive root: it lies in [low, high], no other root does, and the sign of the polynomial changes there
/// from `falling` ? + to - : - to +. `value` is the root to double precision.
struct PositiveRoot {
  double low;
  double high;
  double value;
  bool falling;
};

/// All positive roots and the proof that there are no others: the interval (0, B) beyond which no positive
/// root can lie is halved until each part has zero or one variation of sign in the coefficients of (1+x)^n
/// p(1/(1+x)), which by Descartes and Budan means exactly none or one (Vincent, Collins, Akritas). `complete`
/// is false if a multiple root, or two closer than 2^-200 of B, made the halving stop; then some are missing.
struct PositiveRoots {
  std::vector<PositiveRoot> roots;  ///< in rising order
  bool complete = true;
};
PositiveRoots positive_roots(const WholePolynomial& p);

/// The entries of a factor as whole numbers: each column rounded to 60 bits of its largest entry, which is
/// less than the error of the factor, and all scaled by one power of two.
SquareMatrix<Whole> whole_entries(const Triangle& factor);

}  // namespace drivebench::identification
