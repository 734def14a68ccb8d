#pragma once

#include <Eigen/Dense>
#include <functional>

namespace drivebench::identification {

/// Residuals and their derivatives, a column for each coordinate; false where a point has none.
struct Residuals {
  std::function<bool(const Eigen::VectorXd& at, Eigen::VectorXd& residual)> values;
  std::function<bool(const Eigen::VectorXd& at, Eigen::MatrixXd& jacobian)> derivatives;
};

/// A least squares of residuals of unit variance at its minimum.
struct Fit {
  Eigen::VectorXd at;
  double sum = 0.0;            ///< of squares
  Eigen::MatrixXd covariance;  ///< of the coordinates
  Eigen::VectorXd residual;    ///< at the minimum
  Eigen::MatrixXd jacobian;    ///< of the residuals, at most a hundredth of a standard deviation from there,
                               ///< or what Steps::near allows
  bool found = false;
  bool ended = false;  ///< within the most steps
};

/// How a search moves.
struct Steps {
  double limit;         ///< of the change of a coordinate in a step
  double near = 0.0;    ///< the derivatives stand after a step of less in every coordinate, and of less than
                        ///< ten standard deviations
  double small = 0.01;  ///< a step of so many standard deviations is the last
  int most = 15;        ///< steps
  bool covariance = true;  ///< whether the fit has one; another fit that begins from it needs none
};

/// Gauss-Newton with damping after Levenberg and Marquardt. A direction that the residuals do not show stays
/// where it is and has a standard deviation of 100. The covariance is that of
/// white residuals, or where it is larger, coordinate by coordinate, that of the scatter of the scores of 64
/// parts of the record less what chance makes of it, which holds for residuals that are not white.
/// Derivatives that stand move estimates by some hundredths of a standard deviation.
Fit gauss_newton(const Residuals& residuals, const Eigen::VectorXd& start, const Steps& steps);

}  // namespace drivebench::identification
