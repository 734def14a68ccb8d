#include "clients/identification/refinement/gauss_newton.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace drivebench::identification {
namespace {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

constexpr double kUnknownDeviation = 100.0;
constexpr double kNearStep2 = 100.0;  // of a step in its own standard deviations: derivatives may stand
constexpr Eigen::Index kParts = 64;

/// The residuals at a point and their derivatives.
struct Linear {
  Vector residual;
  Matrix jacobian;
  Matrix information;
};

bool linearise(const Residuals& residuals, const Vector& at, Linear& out) {
  if (!residuals.derivatives(at, out.jacobian)) return false;
  out.information = out.jacobian.transpose() * out.jacobian;
  out.information.diagonal().array() += 1.0 / (kUnknownDeviation * kUnknownDeviation);
  return out.information.allFinite();
}

/// How many times as large as `inverse`, the covariance of white residuals, that about the scatter of the
/// scores of parts of the record makes the variance of each coordinate; 1 at least. White residuals scatter
/// as well, by a variance of 2/n where n equal parts tell a coordinate: a growth of one such deviation is
/// chance.
Vector growth_of(const Linear& l, const Matrix& inverse) {
  const Eigen::Index rows = l.jacobian.rows();
  const Eigen::Index columns = l.jacobian.cols();
  const Vector variance = inverse.diagonal();
  Vector scatter = Vector::Zero(columns);
  Vector chance2 = Vector::Zero(columns);
  for (Eigen::Index part = 0; part < kParts; ++part) {
    const Eigen::Index first = part * rows / kParts;
    const Eigen::Index count = (part + 1) * rows / kParts - first;
    const auto jacobian = l.jacobian.middleRows(first, count);
    const Vector move = inverse * (jacobian.transpose() * l.residual.segment(first, count));
    scatter += move.cwiseAbs2();
    const Matrix expected = jacobian * inverse;
    chance2 +=
        2.0 * (expected.colwise().squaredNorm().transpose().array() / variance.array()).square().matrix();
  }
  const double freedom = static_cast<double>(kParts) / static_cast<double>(kParts - columns);
  return (freedom * scatter.array() / variance.array() - chance2.array().sqrt()).max(1.0);
}

Matrix inverse_of(const Matrix& information) {
  return information.llt().solve(Matrix::Identity(information.rows(), information.cols()));
}

/// The information, and a part of that of each coordinate alone; in valleys of its 1/variance.
Matrix damped_by(double part, const Matrix& information, bool valleys) {
  Matrix damped = information;
  if (valleys)
    damped.diagonal() += part * inverse_of(information).diagonal().cwiseInverse();
  else
    damped.diagonal() *= 1.0 + part;
  return damped;
}

Matrix covariance_of(const Linear& l) {
  const Matrix inverse = inverse_of(l.information);
  const Vector growth = growth_of(l, inverse).cwiseSqrt();
  return growth.asDiagonal() * inverse * growth.asDiagonal();
}

}  // namespace

Fit gauss_newton(const Residuals& residuals, const Vector& start, const Steps& steps) {
  const double small2 = steps.small * steps.small;
  Fit fit;
  fit.at = start;
  fit.sum = std::numeric_limits<double>::infinity();
  Linear l;
  if (!residuals.values(start, l.residual)) return fit;
  fit.sum = l.residual.squaredNorm();
  const Damping how = steps.valleys ? kInValleys : kOfEach;
  double damping = 0.0;
  Vector tried;
  double size2 = 0.0;
  bool near = false;
  for (int step = 0; step < steps.most && !fit.ended; ++step) {
    if (!near && !linearise(residuals, fit.at, l)) return fit;
    const Vector gradient = l.jacobian.transpose() * l.residual;
    bool better = false;
    for (int attempt = 0; attempt < 8 && !better; ++attempt) {
      Vector change = -damped_by(damping, l.information, steps.valleys).llt().solve(gradient);
      const double most = change.cwiseAbs().maxCoeff();
      if (!(most < std::numeric_limits<double>::infinity())) return fit;
      if (most > steps.limit) change *= steps.limit / most;
      size2 = change.dot(l.information * change);
      if (residuals.values(fit.at + change, tried)) {
        const double sum = tried.squaredNorm();
        if (sum <= fit.sum) {
          fit.at += change;
          fit.sum = sum;
          l.residual.swap(tried);
          better = true;
          near = size2 < kNearStep2 && change.cwiseAbs().maxCoeff() < steps.near;
        }
      }
      if (size2 < small2) break;
      damping = better ? how.less * damping : std::max(how.more * damping, how.first);
      if (damping < how.less * how.first) damping = 0.0;
    }
    fit.ended = !better || size2 < small2;
  }
  fit.found = true;
  if (!steps.covariance) return fit;
  fit.covariance = covariance_of(l);
  fit.residual = l.residual;
  fit.jacobian = std::move(l.jacobian);
  fit.found = fit.covariance.allFinite();
  return fit;
}

}  // namespace drivebench::identification
