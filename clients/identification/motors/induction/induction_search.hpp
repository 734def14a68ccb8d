#pragma once

#include <array>
#include <vector>

#include "clients/identification/math/least_squares.hpp"

namespace drivebench::identification {

/// A minimum of the constrained error of the induction motor.
struct InductionMinimum {
  double k4, k6, k8, k14;
  double residual;  ///< E^2
  /// Of E^2 with respect to (K_4, K_6, K_8, K_14).
  std::vector<std::vector<double>> hessian;
  /// K_4, K_6, K_14 > 0 and values that a motor has: 0 < sigma < 1, R_S > 0.
  bool physical;
};

/// All local minima of E^2 over K_8 > 0.
struct InductionSearch {
  std::vector<InductionMinimum> minima;  ///< in rising order of K_8
  int stationary_points = 0;             ///< minima and maxima
  bool complete = true;                  ///< proven: no other minima exist
  int degree = 0;                        ///< of the polynomial whose positive roots they are
};

/// Searches min E^2(K_4, K_6, K_8, K_14), the error of the 15-parameter regression under (8.100), over all
/// K_8 > 0.
///
/// For fixed K_8 the error is quadratic in the other three, so they can be projected out:
///   E^2(K_8) = det S(K_8)/(K_8^2 det G(K_8)),
/// with G the Gram matrix of the three columns that K_4, K_6, K_14 multiply (cubic in K_8) and S that of
/// these and the rest of the equation, K_8 (y - W K) with K_4 = K_6 = K_14 = 0. Its derivative is
/// P(K_8)/(K_8^3 det G^2) with
///   P = K_8 (det G det S' - det S det G') - 2 det S det G,
/// a polynomial of degree 42. The factor of the data, its columns rounded to 60 bits, makes the coefficients
/// of P whole numbers, which are worked out without rounding, and positive_roots() isolates all its positive
/// roots with proof: each lies alone in an interval at whose ends P has exact signs, - to + for a minimum. So
/// `complete` means that no other positive minimum exists for the data as rounded, 2^-60 of each column.
///
/// The book eliminates by resultants instead (degree 104), with the same positive roots at common zeros; a
/// test compares the two. `factor` is the triangle of [W y], 16 x 16. Tag IMID-02.
InductionSearch search_induction(const Triangle& factor);

/// E^2 at any point, for tests and plots.
double induction_error(const Triangle& factor, double k4, double k6, double k8, double k14);

}  // namespace drivebench::identification
