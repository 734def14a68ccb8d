#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "clients/identification/math/series.hpp"

namespace drivebench::identification {

/// An upper triangular matrix by rows: least squares needs no more of the data.
class Triangle {
 public:
  explicit Triangle(std::size_t size) : size_(size), entries_(size * size, 0.0) {}
  std::size_t size() const noexcept { return size_; }
  double& operator()(std::size_t row, std::size_t column) noexcept { return entries_[row * size_ + column]; }
  double operator()(std::size_t row, std::size_t column) const noexcept {
    return entries_[row * size_ + column];
  }

 private:
  std::size_t size_;
  std::vector<double> entries_;
};

/// Whether the data determine the parameters.
struct Excitation {
  bool sufficient = true;
  std::vector<std::string> unseen{};  ///< parameters that the data do not determine, alone or separately
  std::string verdict{};              ///< a sentence
};

/// Adds unseen parameters, without duplicates, and the reason.
void add_unseen(Excitation& excitation, const std::vector<std::string>& names, const std::string& reason);

/// The excitation of two stages together.
Excitation joined(const Excitation& first, const Excitation& second);

/// y = W K in the sense of least squares.
struct LeastSquares {
  std::vector<double> estimate;
  double residual = 0.0;     ///< E^2(K*), sum of the squared equation errors
  double energy = 0.0;       ///< R_y, sum of y^2
  double error_index = 0.0;  ///< sqrt(E^2/R_y), 0 to 1. Source: the book, (2.40); tag IDN-02
  /// The change of a parameter that doubles E^2 (2.46), or makes it 1.25 E^2 (8.116): an order of magnitude
  /// of its error, no standard deviation; it does not fall with the length of the record.
  std::vector<double> index_double;
  std::vector<double> index_quarter;
  double condition = 0.0;         ///< of W with columns of unit length: largest over smallest singular value
  double normal_condition = 0.0;  ///< of R_W = W'W as the book has it, without scaling
  Excitation excitation;
};

/// The limits for the verdict.
struct ExcitationLimits {
  double condition = 1e4;  ///< of the scaled W; above it the weakest direction counts as unseen
  double part = 0.1;       ///< smallest scaled part of a parameter in such a direction that makes it unseen
};

/// Collects the rows of y = W K and keeps their triangular factor only: QR by reflections, so that the
/// condition of the data is not squared, in memory that does not grow with the record.
class Regression {
 public:
  explicit Regression(std::vector<std::string> parameters);
  /// Adds one equation with a coefficient for each parameter.
  void add(SeriesView coefficients, double y);
  std::size_t rows() const noexcept { return rows_; }
  const std::vector<std::string>& parameters() const noexcept { return parameters_; }
  /// R of [W y] = Q R.
  Triangle factor() const;
  /// Throws IdentificationError with fewer rows than parameters or values that are not finite.
  LeastSquares solve(const ExcitationLimits& limits = {}) const;

 private:
  void fold() const;

  std::vector<std::string> parameters_;
  std::size_t rows_ = 0;
  // Rows that are not in the factor yet, column by column; mutable, because folding them in changes no
  // result.
  mutable std::vector<double> block_;
  mutable std::size_t filled_;
};

/// sqrt(limit g' H^-1 g), the largest change of a quantity with gradient g on the ellipsoid dK' H dK = limit,
/// for each row of `gradients`; H is symmetric and positive definite, by rows; infinite otherwise.
std::vector<double> reach(const std::vector<std::vector<double>>& hessian,
                          const std::vector<std::vector<double>>& gradients, double limit);

/// Largest over smallest eigenvalue of a symmetric matrix; infinite unless positive definite. `scaled`: after
/// rows and columns are scaled to a diagonal of ones.
double condition_of(const std::vector<std::vector<double>>& symmetric, bool scaled = false);

}  // namespace drivebench::identification
