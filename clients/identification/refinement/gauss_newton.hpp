#pragma once

#include <Eigen/Dense>
#include <functional>

namespace drivebench::identification {

/// Residuals as a function of coordinates, a column for each point; false where a point has none. Points come
/// together so that their motors may run side by side.
using Residuals = std::function<bool(const Eigen::MatrixXd& points, Eigen::MatrixXd& residuals)>;

/// A least squares of residuals of unit variance at its minimum.
struct Fit {
  Eigen::VectorXd at;
  double sum = 0.0;            ///< of squares
  Eigen::MatrixXd covariance;  ///< of the coordinates
  Eigen::VectorXd residual;    ///< at the minimum
  Eigen::MatrixXd jacobian;    ///< of the residuals, at most a hundredth of a standard deviation from there,
                               ///< or what `near_step` allows
  bool found = false;
};

/// Gauss-Newton with damping after Levenberg and Marquardt, derivatives by forward differences. A direction
/// that the residuals do not show stays where it is and has a standard deviation of 100. The covariance is
/// component by component the larger one of two, by variance: the inverse of the information, and the same
/// about the scatter of the scores of 64 parts of the record, which holds for residuals that are not white.
/// `limit` bounds the change of a coordinate in a step. After a step of less than `near_step` in every
/// coordinate and ten standard deviations the derivatives stand: many coordinates are worth it, and estimates
/// move by some hundredths of a standard deviation.
Fit gauss_newton(const Residuals& residuals, const Eigen::VectorXd& start, double limit,
                 double near_step = 0.0);

}  // namespace drivebench::identification
