#include "clients/identification/wiring/flux_equations.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <span>
#include <string>

#include "clients/identification/data/noise.hpp"
#include "clients/identification/motors/terminal_voltages.hpp"
#include "plant/math/frames.hpp"
#include "plant/math/phasor.hpp"

namespace drivebench::identification {
namespace {

double squared(double x) noexcept {
  return x * x;
}

using Complex = std::complex<double>;
using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

constexpr std::size_t kWindows = 1000;
constexpr std::array<double, 3> kHarmonics = {1.0, -5.0, 7.0};  ///< of a trapezoid's two-phase equivalent

/// An upper bound of the white noise of a signal that is smooth or holds for some samples, rms.
double noise_of(SeriesView x) {
  constexpr double kMedianOfGauss = 0.6744897501960817;
  std::vector<double> steps;
  for (std::size_t k = 1; k < x.size(); ++k)
    steps.push_back(std::abs(x[k] - x[k - 1]));
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return std::min(white_noise(x), *middle / (kMedianOfGauss * std::sqrt(2.0)));
}

/// The largest noise of the phases.
double noise_of(const MeasuredData& data, const Settings& e, char quantity, char unit,
                const SampleRange& range) {
  double noise = 0.0;
  for (std::size_t k = 0; k < phases_of(e); ++k)
    noise = std::max(
        noise, noise_of(data.at(std::string(1, quantity) + '_' + static_cast<char>('a' + k) + '_' + unit)
                            .subspan(range.first, range.count())));
  return noise;
}

/// Phases as one complex number per sample, `later` samples later.
std::vector<Complex> winding(const MeasuredData& data, const Settings& e, char quantity, char unit,
                             int later) {
  std::vector<SeriesView> phases;
  for (std::size_t k = 0; k < phases_of(e); ++k)
    phases.push_back(data.at(std::string(1, quantity) + '_' + static_cast<char>('a' + k) + '_' + unit));
  const auto last = static_cast<std::ptrdiff_t>(data.samples()) - 1;
  std::vector<Complex> x(data.samples());
  for (std::ptrdiff_t k = 0; k <= last; ++k) {
    const auto from = static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(k + later, 0, last));
    Complex& value = x[static_cast<std::size_t>(k)];
    if (phases.size() == 3) {
      const TwoPhase pair = three_to_two({.a = phases[0][from], .b = phases[1][from], .c = phases[2][from]});
      value = {pair.a, pair.b};
    } else {
      value = {phases[0][from], phases.size() == 2 ? phases[1][from] : 0.0};
    }
  }
  return x;
}

/// Least squares with complex rows: a real unknown has a complex column. `parts` of a row carry data, 1 or 2.
class ComplexRows {
 public:
  ComplexRows(std::size_t rows, Eigen::Index columns, int parts)
      : a_(2 * static_cast<Eigen::Index>(rows), columns),
        b_(2 * static_cast<Eigen::Index>(rows)),
        freedom_(std::max(1.0, static_cast<double>(rows) * parts - static_cast<double>(columns))) {}

  void put(std::size_t row, std::span<const Complex> columns, Complex right) {
    const auto r = 2 * static_cast<Eigen::Index>(row);
    for (Eigen::Index k = 0; k < a_.cols(); ++k) {
      a_(r, k) = columns[static_cast<std::size_t>(k)].real();
      a_(r + 1, k) = columns[static_cast<std::size_t>(k)].imag();
    }
    b_(r) = right.real();
    b_(r + 1) = right.imag();
  }

  /// Solves; `noise2` is what noise adds to the square sum of each column. The deviations are those of the
  /// information without the noise's share, together with how far the estimate moves without it: noise in a
  /// column otherwise passes for excitation.
  void solve(std::span<const double> noise2) {
    const Vector size = a_.colwise().norm().cwiseMax(1e-300);
    const Matrix scaled = a_ * size.cwiseInverse().asDiagonal();
    Matrix information = scaled.transpose() * scaled;
    const Vector right = scaled.transpose() * b_;
    constexpr double kRidge = 1e-13;
    information.diagonal().array() += kRidge;
    const Vector z = information.ldlt().solve(right);
    square_sum_ = (scaled * z - b_).squaredNorm();
    for (Eigen::Index k = 0; k < size.size(); ++k)
      information(k, k) -= std::min(1.0, noise2[static_cast<std::size_t>(k)] / (size(k) * size(k)));
    const Eigen::SelfAdjointEigenSolver<Matrix> parts(information);
    const Vector inverse = parts.eigenvalues().cwiseMax(kRidge).cwiseInverse();
    const Matrix& axes = parts.eigenvectors();
    const Vector without = axes * inverse.asDiagonal() * axes.transpose() * right;
    at_ = z.cwiseQuotient(size);
    variance_ = (square_sum_ / freedom_ * (axes * inverse.asDiagonal() * axes.transpose()).diagonal() +
                 (without - z).cwiseAbs2())
                    .cwiseQuotient(size.cwiseAbs2());
  }

  double at(Eigen::Index k) const { return at_(k); }
  double variance(Eigen::Index k) const { return std::abs(variance_(k)); }
  double square_sum() const noexcept { return square_sum_; }
  double share() const { return square_sum_ / std::max(1e-300, b_.squaredNorm()); }

 private:
  Matrix a_;
  Vector b_;
  Vector at_;
  Vector variance_;
  double freedom_;
  double square_sum_ = 0.0;
};

}  // namespace

FluxEquations::FluxEquations(const MeasuredData& data, const Settings& e, int whole_shift)
    : kind_(e.kind), period_s_(data.period_s), whole_shift_(whole_shift) {
  Settings plain = e;
  plain.reversed = false;
  plain.zero_rad = 0.0;
  const SampleRange range = window_of(data, e.processing);
  u_noise_v_ = noise_of(data, e, 'u', 'v', range);
  i_noise_a_ = noise_of(data, e, 'i', 'a', range);
  if (e.counts_per_revolution > 0.0)
    angle_noise_rad_ = 2.0 * std::numbers::pi / e.counts_per_revolution / std::sqrt(12.0);
  add_windows(winding(data, e, 'u', 'v', whole_shift), winding(data, e, 'i', 'a', 0),
              measured_angle(data, plain), range);
}

void FluxEquations::add_windows(const std::vector<Complex>& u, const std::vector<Complex>& i,
                                const Series& angle, const SampleRange& range) {
  const double mean = std::max(1.0, static_cast<double>(range.count()) / kWindows);
  mean_s_ = mean * period_s_;
  Complex flux;
  Complex charge;
  std::size_t length = 0;
  for (std::size_t begin = range.first; begin < range.end; begin += length) {
    constexpr double kGolden = 0.6180339887498949;
    const double part = std::fmod(kGolden * static_cast<double>(windows_.size()), 1.0);
    length = std::max<std::size_t>(1, static_cast<std::size_t>(std::lround(mean * (0.5 + part))));
    if (begin + length >= range.end) break;
    Window w{};
    w.duration_s = static_cast<double>(length) * period_s_;
    for (std::size_t k = begin; k < begin + length; ++k) {
      const Complex u_mid = 0.5 * (u[k] + u[k + 1]);
      const Complex i_mid = 0.5 * (i[k] + i[k + 1]);
      const double step = angle[k + 1] - angle[k];
      const Complex flux_mid = flux + 0.5 * period_s_ * u_mid;
      const Complex charge_mid = charge + 0.5 * period_s_ * i_mid;
      w.flux_time += period_s_ * flux_mid;
      w.charge_time += period_s_ * charge_mid;
      w.over_angle_flux += step * flux_mid;
      w.over_angle_charge += step * charge_mid;
      w.over_angle_i += step * i_mid;
      w.over_angle_u += step * u_mid;
      w.u_integral += period_s_ * u_mid;
      w.i_integral += period_s_ * i_mid;
      flux += period_s_ * u_mid;
      charge += period_s_ * i_mid;
    }
    const std::size_t end = begin + length;
    w.u_step = u[end] - u[begin];
    w.first_i = i[begin];
    w.last_i = i[end];
    w.i_step = w.last_i - w.first_i;
    w.first_angle = angle[begin];
    w.last_angle = angle[end];
    w.angle_step = w.last_angle - w.first_angle;
    fastest_rad_ = std::max(fastest_rad_, std::abs(w.angle_step) / static_cast<double>(length));
    windows_.push_back(w);
  }
}

std::size_t FluxEquations::columns(bool salient) const noexcept {
  if (kind_ == MotorKind::kInduction) return 10;
  return kind_ == MotorKind::kDc ? 5 : 5 + 2 * harmonics() + (salient ? 2 : 0);
}

std::size_t FluxEquations::harmonics() const noexcept {
  return kind_ == MotorKind::kBldc ? kHarmonics.size() : 1;
}

/// Columns: the shift, R, L; then the magnet and its saliency, or what an induction motor has; last what
/// offsets of voltages and currents add up to, which an induction motor has among its own.
Complex FluxEquations::put_row(const Window& w, double n, bool salient, std::span<Complex> c) const {
  constexpr Complex kJ(0.0, 1.0);
  c[0] = -period_s_ * w.u_step;
  c[1] = w.i_integral;
  c[2] = w.i_step;
  if (kind_ == MotorKind::kInduction) {
    c[0] += kJ * n * period_s_ * w.over_angle_u;
    c[1] -= kJ * n * w.over_angle_charge;
    c[2] -= kJ * n * w.over_angle_i;
    c[3] = -w.flux_time;   // 1/T_R
    c[4] = w.charge_time;  // R/T_R
    c[5] = w.i_integral;   // L_S/T_R, beside R where the motor stands
    c[6] = kJ * n * w.angle_step;
    c[7] = -n * w.angle_step;
  } else if (kind_ == MotorKind::kDc) {
    c[3] = n * w.angle_step;
    c[4] = w.duration_s;
    return w.u_integral;
  } else {
    for (std::size_t h = 0; h < harmonics(); ++h) {
      const double order = n * kHarmonics[h];
      c[3 + 2 * h] = phasor(order * w.last_angle) - phasor(order * w.first_angle);
      c[4 + 2 * h] = kJ * c[3 + 2 * h];
    }
    if (salient) {
      const std::size_t first = 3 + 2 * harmonics();
      c[first] = phasor(2.0 * n * w.last_angle) * std::conj(w.last_i) -
                 phasor(2.0 * n * w.first_angle) * std::conj(w.first_i);
      c[first + 1] = kJ * c[first];
    }
  }
  c[c.size() - 2] = w.duration_s;
  c[c.size() - 1] = kJ * w.duration_s;
  return kind_ == MotorKind::kInduction ? w.u_integral - kJ * n * w.over_angle_flux : w.u_integral;
}

/// What noise adds to the square sums of the columns.
std::vector<double> FluxEquations::noise_of_columns(double n, bool salient) const {
  const bool dc = kind_ == MotorKind::kDc;
  const double each = (dc ? 1.0 : 2.0) * static_cast<double>(windows_.size());
  std::vector<double> noise2(columns(salient), 0.0);
  noise2[0] = 2.0 * each * squared(period_s_ * u_noise_v_);
  noise2[1] = each * period_s_ * mean_s_ * squared(i_noise_a_);
  noise2[2] = 2.0 * each * squared(i_noise_a_);
  if (dc) noise2[3] = 2.0 * each * squared(angle_noise_rad_);
  if (dc || kind_ == MotorKind::kInduction) return noise2;
  for (std::size_t h = 0; h < harmonics(); ++h)
    noise2[3 + 2 * h] = noise2[4 + 2 * h] = each * squared(n * kHarmonics[h] * angle_noise_rad_);
  if (salient) noise2[3 + 2 * harmonics()] = noise2[4 + 2 * harmonics()] = noise2[2];
  return noise2;
}

FluxFit FluxEquations::fit(int turn, bool salient) const {
  const double n = turn;
  const bool dc = kind_ == MotorKind::kDc;
  const auto solved = [&](double pairs) {
    ComplexRows rows(windows_.size(), static_cast<Eigen::Index>(columns(salient)), dc ? 1 : 2);
    std::vector<Complex> c(columns(salient));
    for (std::size_t k = 0; k < windows_.size(); ++k) {
      const Complex right = put_row(windows_[k], pairs, salient, c);
      rows.put(k, c, right);
    }
    rows.solve(noise_of_columns(pairs, salient));
    return rows;
  };
  ComplexRows rows = solved(n);
  if (dc && rows.at(3) < 0.0) rows = solved(0.0);  // the best torque constant is none
  FluxFit fit{.square_sum = rows.square_sum(),
              .share = rows.share(),
              .voltage_shift = rows.at(0) + whole_shift_,
              .shift_deviation = std::sqrt(rows.variance(0))};
  if (kind_ != MotorKind::kInduction && !dc) {
    const Complex magnet(rows.at(3), rows.at(4));
    fit.zero_rad = argument(magnet);
    fit.zero_deviation =
        std::sqrt(std::max(rows.variance(3), rows.variance(4))) / std::max(1e-300, magnitude(magnet));
  }
  return fit;
}

}  // namespace drivebench::identification
