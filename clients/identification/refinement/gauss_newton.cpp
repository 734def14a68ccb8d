#include "clients/identification/refinement/gauss_newton.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace drivebench::identification {
namespace {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

constexpr double kDifference = 1e-5;
constexpr double kUnknownDeviation = 100.0;
constexpr int kMostGaussNewtonSteps = 15;
constexpr double kSmallStep2 = 1e-4;  // of a step in its own standard deviations, squared
constexpr double kNearStep2 = 100.0;  // the same: derivatives may stand
constexpr Eigen::Index kParts = 64;

/// The residuals at a point and their derivatives.
struct Linear {
  Matrix residual;  ///< one column
  Matrix jacobian;
  Matrix information;
};

bool linearise(const Residuals& residuals, const Vector& at, Linear& out) {
  Matrix points = at.replicate(1, at.size());
  points.diagonal().array() += kDifference;
  if (!residuals(points, out.jacobian)) return false;
  out.jacobian.colwise() -= out.residual.col(0);
  out.jacobian *= 1.0 / kDifference;
  out.information = out.jacobian.transpose() * out.jacobian;
  out.information.diagonal().array() += 1.0 / (kUnknownDeviation * kUnknownDeviation);
  return out.information.allFinite();
}

/// The covariance about the scatter of the scores of parts of the record.
Matrix scattered(const Linear& l, const Matrix& inverse) {
  const Eigen::Index rows = l.jacobian.rows();
  const Eigen::Index columns = l.jacobian.cols();
  Matrix scatter = Matrix::Zero(columns, columns);
  for (Eigen::Index part = 0; part < kParts; ++part) {
    const Eigen::Index first = part * rows / kParts;
    const Eigen::Index count = (part + 1) * rows / kParts - first;
    const Vector score =
        l.jacobian.middleRows(first, count).transpose() * l.residual.col(0).segment(first, count);
    scatter += score * score.transpose();
  }
  const double freedom = static_cast<double>(kParts) / static_cast<double>(kParts - columns);
  return freedom * inverse * scatter * inverse;
}

Matrix covariance_of(const Linear& l) {
  const Matrix inverse =
      l.information.llt().solve(Matrix::Identity(l.information.rows(), l.information.cols()));
  const Matrix robust = scattered(l, inverse);
  const Vector growth = (robust.diagonal().array() / inverse.diagonal().array()).max(1.0).sqrt();
  return growth.asDiagonal() * inverse * growth.asDiagonal();
}

}  // namespace

Fit gauss_newton(const Residuals& residuals, const Vector& start, double limit, double near_step) {
  Fit fit;
  fit.at = start;
  fit.sum = std::numeric_limits<double>::infinity();
  Linear l;
  if (!residuals(start, l.residual)) return fit;
  fit.sum = l.residual.squaredNorm();
  double damping = 0.0;
  Matrix tried;
  double size2 = 0.0;
  bool near = false;
  for (int step = 0; step < kMostGaussNewtonSteps; ++step) {
    if (!near && !linearise(residuals, fit.at, l)) return fit;
    const Vector gradient = l.jacobian.transpose() * l.residual.col(0);
    bool better = false;
    for (int attempt = 0; attempt < 8 && !better; ++attempt) {
      Matrix damped = l.information;
      damped.diagonal() *= 1.0 + damping;
      Vector change = -damped.llt().solve(gradient);
      const double most = change.cwiseAbs().maxCoeff();
      if (!(most < std::numeric_limits<double>::infinity())) return fit;
      if (most > limit) change *= limit / most;
      size2 = change.dot(l.information * change);
      if (residuals(fit.at + change, tried)) {
        const double sum = tried.squaredNorm();
        if (sum <= fit.sum) {
          fit.at += change;
          fit.sum = sum;
          l.residual.swap(tried);
          better = true;
          near = size2 < kNearStep2 && change.cwiseAbs().maxCoeff() < near_step;
        }
      }
      if (size2 < kSmallStep2) break;
      damping = better ? 0.1 * damping : std::max(10.0 * damping, 1e-3);
      if (damping < 1e-4) damping = 0.0;
    }
    if (!better || size2 < kSmallStep2) break;
  }
  fit.covariance = covariance_of(l);
  fit.residual = l.residual.col(0);
  fit.jacobian = std::move(l.jacobian);
  fit.found = fit.covariance.allFinite();
  return fit;
}

}  // namespace drivebench::identification
