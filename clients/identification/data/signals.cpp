#include "clients/identification/data/signals.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>

#include "plant/math/frames.hpp"
#include "plant/math/unbounded.hpp"

namespace drivebench::identification {
namespace {

void need(SeriesView x, std::size_t samples) {
  if (x.size() < samples)
    throw IdentificationError("a derivative needs at least " + std::to_string(samples) +
                              " samples, there are " + std::to_string(x.size()));
}

/// The cubic through the four samples around a place that lies so many samples after another one.
class Cubic {
 public:
  explicit Cubic(double samples) noexcept : whole_(static_cast<std::ptrdiff_t>(std::floor(samples))) {
    const double t = samples - std::floor(samples);
    weight_ = {-t * (t - 1.0) * (t - 2.0) / 6.0, (t + 1.0) * (t - 1.0) * (t - 2.0) / 2.0,
               -(t + 1.0) * t * (t - 2.0) / 2.0, (t + 1.0) * t * (t - 1.0) / 6.0};
  }
  double at(SeriesView x, std::ptrdiff_t sample) const noexcept {
    const auto last = static_cast<std::ptrdiff_t>(x.size()) - 1;
    double sum = 0.0;
    for (std::ptrdiff_t j = 0; j < 4; ++j) {
      const std::ptrdiff_t place = std::clamp(sample + whole_ + j - 1, std::ptrdiff_t{0}, last);
      sum += weight_[static_cast<std::size_t>(j)] * x[static_cast<std::size_t>(place)];
    }
    return sum;
  }

 private:
  std::ptrdiff_t whole_;
  std::array<double, 4> weight_{};
};

}  // namespace

Series central_difference(SeriesView x, double period_s) {
  need(x, 3);
  const std::size_t n = x.size();
  Series y(n);
  for (std::size_t k = 1; k + 1 < n; ++k)
    y[k] = (x[k + 1] - x[k - 1]) / (2.0 * period_s);
  y[0] = (4.0 * x[1] - 3.0 * x[0] - x[2]) / (2.0 * period_s);
  y[n - 1] = (3.0 * x[n - 1] - 4.0 * x[n - 2] + x[n - 3]) / (2.0 * period_s);
  return y;
}

Series second_difference(SeriesView x, double period_s) {
  need(x, 3);
  const std::size_t n = x.size();
  Series y(n);
  for (std::size_t k = 1; k + 1 < n; ++k)
    y[k] = (x[k + 1] - 2.0 * x[k] + x[k - 1]) / (period_s * period_s);
  y[0] = y[1];
  y[n - 1] = y[n - 2];
  return y;
}

Series backward_difference(SeriesView x, double period_s) {
  need(x, 2);
  Series y(x.size());
  for (std::size_t k = 1; k < x.size(); ++k)
    y[k] = (x[k] - x[k - 1]) / period_s;
  y[0] = y[1];
  return y;
}

Series advanced(SeriesView x, double samples) {
  if (samples == 0.0 || x.empty()) return {x.begin(), x.end()};
  const Cubic cubic(samples);
  Series y(x.size());
  for (std::size_t k = 0; k < x.size(); ++k)
    y[k] = cubic.at(x, static_cast<std::ptrdiff_t>(k));
  return y;
}

double value_at(SeriesView x, double position) noexcept {
  const double place = std::clamp(position, 0.0, static_cast<double>(x.size() - 1));
  return Cubic(place).at(x, 0);
}

double largest(SeriesView x) noexcept {
  double most = 0.0;
  for (const double value : x)
    most = std::max(most, std::abs(value));
  return most;
}

bool begins_at_rest(std::span<const SeriesView> currents, SeriesView speed) noexcept {
  constexpr double kNoCurrent = 0.03;
  constexpr double kNoSpeed = 0.05;
  if (std::abs(speed[0]) > kNoSpeed * largest(speed)) return false;
  return std::ranges::all_of(currents,
                             [](SeriesView i) { return std::abs(i[0]) <= kNoCurrent * largest(i); });
}

TwoPhaseSeries two_phase(SeriesView a, SeriesView b, SeriesView c) {
  TwoPhaseSeries y = {.a = Series(a.size()), .b = Series(a.size())};
  for (std::size_t k = 0; k < a.size(); ++k) {
    const TwoPhase pair = three_to_two({.a = a[k], .b = b[k], .c = c[k]});
    y.a[k] = pair.a;
    y.b[k] = pair.b;
  }
  return y;
}

TwoPhaseSeries rotated(const TwoPhaseSeries& x, SeriesView angle_rad) {
  TwoPhaseSeries y = {.a = Series(x.a.size()), .b = Series(x.a.size())};
  for (std::size_t k = 0; k < x.a.size(); ++k) {
    const auto [cosine, sine] = cos_sin_unbounded(angle_rad[k]);
    y.a[k] = cosine * x.a[k] + sine * x.b[k];
    y.b[k] = cosine * x.b[k] - sine * x.a[k];
  }
  return y;
}

Series angle_of(SeriesView counts, double counts_per_revolution, bool half_count) {
  Series angle_rad(counts.size());
  const double step = 2.0 * std::numbers::pi / counts_per_revolution;
  for (std::size_t k = 0; k < counts.size(); ++k)
    angle_rad[k] = step * (counts[k] + (half_count ? 0.5 : 0.0));
  return angle_rad;
}

}  // namespace drivebench::identification
