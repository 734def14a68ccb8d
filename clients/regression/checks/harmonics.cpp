#include "clients/regression/checks/harmonics.hpp"

#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>

#include "plant/math/length.hpp"
#include "plant/math/phasor.hpp"

namespace drivebench::regression {
namespace {

using Complex = std::complex<double>;

/// exp(j·2π·turns), turned on sample by sample: each step rounds once more, so it begins anew every 64.
class Phasor {
 public:
  explicit Phasor(double turns_a_sample) noexcept
      : turns_(turns_a_sample), step_(phasor(2.0 * std::numbers::pi * turns_a_sample)) {}

  Complex at(std::size_t k) noexcept {
    if (k % 64 == 0) {
      const double turns = turns_ * static_cast<double>(k);
      now_ = phasor(2.0 * std::numbers::pi * (turns - std::floor(turns)));
    } else {
      now_ *= step_;
    }
    return now_;
  }

 private:
  double turns_;
  Complex step_;
  Complex now_ = 1.0;
};

/// The normal equations of the fit. The unknowns are m, a_1, b_1, a_2, b_2 ...
struct NormalEquations {
  std::size_t size;
  std::vector<double> matrix;  ///< symmetric; row after row
  std::vector<double> right;

  double& at(std::size_t row, std::size_t column) { return matrix[row * size + column]; }
};

/// The sums of exp(j·2π·n·f·k), for n up to twice the last harmonic, make the products of all columns.
NormalEquations normal_equations(std::span<const double> values, double periods_a_sample,
                                 std::size_t harmonics) {
  std::vector<Complex> sums(2 * harmonics + 1);
  std::vector<Complex> products(harmonics + 1);
  Phasor fundamental(periods_a_sample);
  for (std::size_t k = 0; k < values.size(); ++k) {
    const Complex step = fundamental.at(k);
    Complex power = 1.0;
    for (std::size_t n = 0; n < sums.size(); ++n) {
      sums[n] += power;
      if (n <= harmonics) products[n] += values[k] * power;
      power *= step;
    }
  }
  const std::size_t size = 2 * harmonics + 1;
  NormalEquations e{
      .size = size, .matrix = std::vector<double>(size * size), .right = std::vector<double>(size)};
  const auto place = [](std::size_t n) { return n == 0 ? std::size_t{0} : 2 * n - 1; };
  for (std::size_t n = 0; n <= harmonics; ++n) {
    e.right[place(n)] = products[n].real();
    if (n > 0) e.right[2 * n] = products[n].imag();
    for (std::size_t m = 0; m <= n; ++m) {
      const Complex sum = sums[n + m];
      const Complex difference = sums[n - m];
      const auto put = [&e](std::size_t row, std::size_t column, double value) {
        e.at(row, column) = e.at(column, row) = 0.5 * value;
      };
      put(place(n), place(m), difference.real() + sum.real());
      if (n > 0) put(2 * n, place(m), sum.imag() + difference.imag());
      if (m > 0) put(place(n), 2 * m, sum.imag() - difference.imag());
      if (n > 0 && m > 0) put(2 * n, 2 * m, difference.real() - sum.real());
    }
  }
  return e;
}

/// Solves by Cholesky's method, in place.
std::vector<double> solved(NormalEquations e) {
  for (std::size_t i = 0; i < e.size; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      double sum = e.at(i, j);
      for (std::size_t k = 0; k < j; ++k)
        sum -= e.at(i, k) * e.at(j, k);
      e.at(i, j) = i == j ? std::sqrt(sum) : sum / e.at(j, j);
    }
  }
  std::vector<double> x = e.right;
  for (std::size_t i = 0; i < e.size; ++i) {
    for (std::size_t k = 0; k < i; ++k)
      x[i] -= e.at(i, k) * x[k];
    x[i] /= e.at(i, i);
  }
  for (std::size_t i = e.size; i-- > 0;) {
    for (std::size_t k = i + 1; k < e.size; ++k)
      x[i] -= e.at(k, i) * x[k];
    x[i] /= e.at(i, i);
  }
  return x;
}

/// The strength of a frequency under a Hann window.
double hann_strength(std::span<const double> values, double mean, double periods_a_sample) {
  Phasor wave(periods_a_sample);
  Phasor window(1.0 / static_cast<double>(values.size()));
  Complex sum = 0.0;
  for (std::size_t k = 0; k < values.size(); ++k)
    sum += (values[k] - mean) * (1.0 - window.at(k).real()) * wave.at(k);
  return std::norm(sum);
}

/// The place of the maximum between two frequencies that have just one, by golden sections.
template <class Function>
double maximum_between(double low, double high, Function f) {
  constexpr double kGolden = 1.0 / std::numbers::phi;
  double left = high - kGolden * (high - low);
  double right = low + kGolden * (high - low);
  double at_left = f(left);
  double at_right = f(right);
  for (int i = 0; i < 40; ++i) {
    if (at_left > at_right) {
      high = right;
      right = left;
      at_right = at_left;
      left = high - kGolden * (high - low);
      at_left = f(left);
    } else {
      low = left;
      left = right;
      at_left = at_right;
      right = low + kGolden * (high - low);
      at_right = f(right);
    }
  }
  return 0.5 * (low + high);
}

/// Periods a sample between the first and the last rise from below to above the band around the mean.
std::optional<double> frequency_of_rises(std::span<const double> values, double mean, double band) {
  bool was_below = false;
  std::size_t rises = 0;
  std::size_t first = 0;
  std::size_t last = 0;
  for (std::size_t k = 0; k < values.size(); ++k) {
    if (values[k] < mean - band) was_below = true;
    if (!was_below || values[k] <= mean + band) continue;
    was_below = false;
    last = k;
    if (rises++ == 0) first = k;
  }
  if (rises < 2) return std::nullopt;
  return static_cast<double>(rises - 1) / static_cast<double>(last - first);
}

}  // namespace

std::vector<double> harmonic_amplitudes(std::span<const double> values, double periods_a_sample,
                                        int harmonics) {
  const auto last = static_cast<std::size_t>(harmonics);
  const std::vector<double> x = solved(normal_equations(values, periods_a_sample, last));
  std::vector<double> amplitudes{std::abs(x[0])};
  amplitudes.reserve(last + 1);
  for (std::size_t n = 1; n <= last; ++n)
    amplitudes.push_back(length(x[2 * n - 1], x[2 * n]));
  return amplitudes;
}

std::optional<double> fundamental_of(std::span<const double> values) {
  double sum = 0.0;
  for (const double value : values)
    sum += value;
  const double mean = sum / static_cast<double>(values.size());
  double squares = 0.0;
  for (const double value : values)
    squares += (value - mean) * (value - mean);
  const double band = 0.5 * std::sqrt(squares / static_cast<double>(values.size()));
  const std::optional<double> about = frequency_of_rises(values, mean, band);
  if (!about) return std::nullopt;
  const double around = 0.5 / static_cast<double>(values.size());
  return maximum_between(*about - around, *about + around,
                         [&](double f) { return hann_strength(values, mean, f); });
}

}  // namespace drivebench::regression
