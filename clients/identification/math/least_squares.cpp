#include "clients/identification/math/least_squares.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace drivebench::identification {
namespace {

constexpr std::size_t kBlockRows = 256;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

Eigen::Index index(std::size_t n) {
  return static_cast<Eigen::Index>(n);
}

std::vector<double> to_std(const Vector& x) {
  return {x.data(), x.data() + x.size()};
}

std::string list_of(const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t k = 0; k < names.size(); ++k)
    text += (k == 0 ? "" : k + 1 == names.size() ? " and " : ", ") + names[k];
  return text;
}

/// Names the parameters in the directions that the scaled data hardly determine.
Excitation judge(const std::vector<std::string>& parameters, const Vector& column_length,
                 const Eigen::JacobiSVD<Matrix>& svd, const ExcitationLimits& limits) {
  Excitation found;
  const Vector& singular = svd.singularValues();
  std::vector<bool> unseen(parameters.size(), false);
  for (Eigen::Index d = 0; d < singular.size(); ++d) {
    if (singular(d) * limits.condition > singular(0)) continue;
    for (std::size_t k = 0; k < parameters.size(); ++k)
      unseen[k] = unseen[k] || std::abs(svd.matrixV()(index(k), d)) > limits.part;
  }
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    if (unseen[k] || !(column_length(index(k)) > 0.0)) found.unseen.push_back(parameters[k]);
  }
  found.sufficient = found.unseen.empty();
  if (found.sufficient) {
    found.verdict = "the data see every parameter";
  } else {
    found.verdict = "not identifiable: the data do not tell " + list_of(found.unseen) +
                    (found.unseen.size() > 1 ? " from each other" : "");
  }
  return found;
}

}  // namespace

void add_unseen(Excitation& excitation, const std::vector<std::string>& names, const std::string& reason) {
  for (const std::string& name : names) {
    auto& unseen = excitation.unseen;
    if (std::find(unseen.begin(), unseen.end(), name) == unseen.end()) unseen.push_back(name);
  }
  excitation.verdict = (excitation.sufficient ? "not identifiable: " : excitation.verdict + "; ") + reason;
  excitation.sufficient = false;
}

Excitation joined(const Excitation& first, const Excitation& second) {
  Excitation both = first.sufficient ? second : first;
  if (!first.sufficient && !second.sufficient) {
    both.unseen.insert(both.unseen.end(), second.unseen.begin(), second.unseen.end());
    both.verdict += "; " + second.verdict;
  }
  return both;
}

Regression::Regression(std::vector<std::string> parameters)
    : parameters_(std::move(parameters)),
      block_((parameters_.size() + 1) * (kBlockRows + parameters_.size() + 1), 0.0),
      filled_(parameters_.size() + 1) {}

void Regression::add(SeriesView coefficients, double y) {
  const std::size_t n = parameters_.size() + 1;
  const std::size_t height = kBlockRows + n;
  for (std::size_t k = 0; k + 1 < n; ++k)
    block_[k * height + filled_] = coefficients[k];
  block_[(n - 1) * height + filled_] = y;
  ++rows_;
  if (++filled_ == height) fold();
}

void Regression::fold() const {
  const std::size_t n = parameters_.size() + 1;
  const std::size_t height = kBlockRows + n;
  Eigen::Map<Matrix> block(block_.data(), index(height), index(n));
  block.bottomRows(index(height - filled_)).setZero();
  const Eigen::HouseholderQR<Matrix> qr(block);
  block.setZero();
  block.topRows(index(n)).triangularView<Eigen::Upper>() = qr.matrixQR().topRows(index(n));
  filled_ = n;
}

Triangle Regression::factor() const {
  fold();
  const std::size_t n = parameters_.size() + 1;
  const std::size_t height = kBlockRows + n;
  Triangle r(n);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = i; j < n; ++j)
      r(i, j) = block_[j * height + i];
  }
  return r;
}

LeastSquares Regression::solve(const ExcitationLimits& limits) const {
  const std::size_t n = parameters_.size();
  if (rows_ < n)
    throw IdentificationError("too few data: " + std::to_string(rows_) + " equations for " +
                              std::to_string(n) + " parameters");
  const Triangle factor_of_data = factor();
  Matrix r(index(n + 1), index(n + 1));
  for (std::size_t i = 0; i <= n; ++i) {
    for (std::size_t j = 0; j <= n; ++j)
      r(index(i), index(j)) = factor_of_data(i, j);
  }
  if (!r.allFinite()) throw IdentificationError("the data contain values that are not finite, or too large");
  const Matrix w = r.topLeftCorner(index(n), index(n));
  const Vector y = r.topRightCorner(index(n), 1);
  const Vector length = w.colwise().norm();
  const Vector scale = length.unaryExpr([](double x) { return x > 0.0 ? 1.0 / x : 1.0; });
  const Eigen::JacobiSVD<Matrix> svd(w * scale.asDiagonal(), Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::JacobiSVD<Matrix> raw(w);

  LeastSquares found;
  found.residual = r(index(n), index(n)) * r(index(n), index(n));
  found.energy = r.col(index(n)).squaredNorm();
  found.error_index = found.energy > 0.0 ? std::sqrt(found.residual / found.energy) : 0.0;
  const auto ratio = [](const Vector& s) {
    return s(s.size() - 1) > 0.0 ? s(0) / s(s.size() - 1) : kInfinity;
  };
  found.condition = ratio(svd.singularValues());
  found.normal_condition = ratio(raw.singularValues()) * ratio(raw.singularValues());
  found.excitation = judge(parameters_, length, svd, limits);
  // K = scale V S^-1 U' y, without directions that are lost in rounding.
  const double floor = 1e-15 * svd.singularValues()(0);
  Matrix inverse = Matrix::Zero(index(n), index(n));
  for (Eigen::Index d = 0; d < index(n); ++d) {
    if (svd.singularValues()(d) > floor) inverse.col(d) = svd.matrixV().col(d) / svd.singularValues()(d);
  }
  inverse = scale.asDiagonal() * inverse;
  found.estimate = to_std(inverse * (svd.matrixU().transpose() * y));
  for (std::size_t k = 0; k < n; ++k) {
    const double doubled = std::sqrt(found.residual) * inverse.row(index(k)).norm();
    found.index_double.push_back(doubled);
    found.index_quarter.push_back(0.5 * doubled);
  }
  return found;
}

namespace {

Matrix matrix_of(const std::vector<std::vector<double>>& rows) {
  Matrix m(index(rows.size()), index(rows.empty() ? 0 : rows[0].size()));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    for (std::size_t j = 0; j < rows[i].size(); ++j)
      m(index(i), index(j)) = rows[i][j];
  }
  return m;
}

/// D with D M D of unit diagonal.
Vector unit_diagonal(const Matrix& m) {
  return m.diagonal().unaryExpr([](double x) { return x > 0.0 ? 1.0 / std::sqrt(x) : 1.0; });
}

}  // namespace

std::vector<double> reach(const std::vector<std::vector<double>>& hessian,
                          const std::vector<std::vector<double>>& gradients, double limit) {
  const Matrix h = matrix_of(hessian);
  const Vector scale = unit_diagonal(h);
  const Eigen::LLT<Matrix> factor(scale.asDiagonal() * h * scale.asDiagonal());
  std::vector<double> far(gradients.size(), kInfinity);
  if (factor.info() != Eigen::Success) return far;
  for (std::size_t k = 0; k < gradients.size(); ++k) {
    Vector g = Eigen::Map<const Vector>(gradients[k].data(), index(gradients[k].size()));
    g = scale.asDiagonal() * g;
    far[k] = std::sqrt(limit) * factor.matrixL().solve(g).norm();
  }
  return far;
}

double condition_of(const std::vector<std::vector<double>>& symmetric, bool scaled) {
  Matrix m = matrix_of(symmetric);
  if (scaled) {
    const Vector scale = unit_diagonal(m);
    m = (scale.asDiagonal() * m * scale.asDiagonal()).eval();
  }
  const Vector values = Eigen::SelfAdjointEigenSolver<Matrix>(m, Eigen::EigenvaluesOnly).eigenvalues();
  const double least = values(0);
  return least > 0.0 ? values(values.size() - 1) / least : kInfinity;
}

}  // namespace drivebench::identification
