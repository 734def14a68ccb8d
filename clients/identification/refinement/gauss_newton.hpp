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

/// The part of the information that is added to it where a step fails.
struct Damping {
  double first;  ///< of the first attempt that is damped
  double more;   ///< times as much after an attempt that fails
  double less;   ///< times as much after one that does not
};
/// Of each coordinate's own information, which holds if all others were known.
inline constexpr Damping kOfEach = {.first = 1e-3, .more = 10.0, .less = 0.1};
/// Of 1/variance of each coordinate, its information if no other were known. Coordinates that are known well
/// only together, as the inductance and the time constant of a rotor are, lie in a valley: damped by what
/// each of them tells, steps along it end before its bottom.
inline constexpr Damping kInValleys = {.first = 0.1, .more = 4.0, .less = 0.25};

/// How a search moves.
struct Steps {
  double limit;          ///< of the change of a coordinate in a step
  double near = 0.0;     ///< the derivatives stand after a step of less in every coordinate, and of less than
                         ///< ten standard deviations
  double small = 0.01;   ///< a step of so many standard deviations is the last
  int most = 15;         ///< steps
  bool valleys = false;  ///< damping is kInValleys, not kOfEach
  bool covariance = true;  ///< whether the fit has one; another fit that begins from it needs none
};

/// Gauss-Newton with damping after Levenberg and Marquardt. A direction that the residuals do not show stays
/// where it is and has a standard deviation of 100. The covariance is that of
/// white residuals, or where it is larger, coordinate by coordinate, that of the scatter of the scores of 64
/// parts of the record less what chance makes of it, which holds for residuals that are not white.
/// Derivatives that stand move estimates by some hundredths of a standard deviation.
Fit gauss_newton(const Residuals& residuals, const Eigen::VectorXd& start, const Steps& steps);

}  // namespace drivebench::identification
