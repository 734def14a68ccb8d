#pragma once

#include <Eigen/Dense>
#include <string>
#include <vector>

#include "clients/identification/motors/bending_induction.hpp"
#include "clients/identification/refinement/gauss_newton.hpp"
#include "clients/identification/refinement/unknowns.hpp"

namespace drivebench::identification {

/// What a fit of a motor with straight iron says of a magnetising curve that bends.
struct BendTest {
  /// The gain in likelihood that a bend would bring, to first order (the score test of Lagrange multipliers):
  /// of straight iron and white innovations chi-squared with two degrees of freedom.
  double evidence = 0.0;
  double part = 0.0;      ///< that a gentle bend takes of the magnetising current at the largest flux
  double interval = 0.0;  ///< half of its 95 % interval
  std::string moved{};    ///< the parameter that a bend as large as the interval would move most
  double shift = 0.0;     ///< by this part of its value
};

/// The powers of the flux of the bends that are looked for: iron that bends early, and iron with a knee.
inline constexpr double kBendPowers[] = {2.0, 8.0};

/// A motor at the fit with a bend of each power, which grows up to the flux that 95 % of the samples do not
/// exceed: the first samples of a run know the flux to within that of the largest current.
std::vector<BendingInductionModel> bending_motors(Series flux_wb, const BendingInductionModel& straight,
                                                  double bend);

/// Beyond this evidence, noise in one of 1,000 records, the iron bends.
inline constexpr double kTellsBend = 13.8;

/// `directions` are the derivatives of the residuals of the fit by the bends, a column for each power.
BendTest test_bend(const Fit& fit, const std::vector<Unknown>& unknowns, const Eigen::MatrixXd& directions);

/// What the record says of a bend that it does not tell from none.
std::string straight_note(const BendTest& test);

}  // namespace drivebench::identification
