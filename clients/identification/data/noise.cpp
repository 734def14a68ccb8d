#include "clients/identification/data/noise.hpp"

#include <algorithm>
#include <cmath>

namespace drivebench::identification {
namespace {

/// The smallest step between two neighbours, 0 for a signal that takes more values than a converter has.
double quantisation_step(SeriesView x) {
  constexpr double kLevels = 1 << 20;  // what a converter of 20 bits tells apart
  const auto [least, most] = std::ranges::minmax_element(x);
  const double finest = (*most - *least) / kLevels;
  double step = *most - *least;
  for (std::size_t k = 1; k < x.size(); ++k) {
    const double change = std::abs(x[k] - x[k - 1]);
    if (change > 0.0) step = std::min(step, change);
  }
  return step > finest ? step : 0.0;
}

/// The rms of the white part from the median of the fourth differences.
double difference_noise(SeriesView x) {
  constexpr double kMedianOfGauss = 0.6744897501960817;
  constexpr double kGain2 = 70.0;  // 1 + 16 + 36 + 16 + 1
  Series size;
  size.reserve(x.size());
  for (std::size_t k = 2; k + 2 < x.size(); ++k)
    size.push_back(std::abs(x[k - 2] - 4.0 * x[k - 1] + 6.0 * x[k] - 4.0 * x[k + 1] + x[k + 2]));
  const auto middle = size.begin() + static_cast<std::ptrdiff_t>(size.size() / 2);
  std::nth_element(size.begin(), middle, size.end());
  return *middle / (kMedianOfGauss * std::sqrt(kGain2));
}

}  // namespace

double white_noise(SeriesView x) {
  if (x.size() < 5) return 0.0;
  return std::max(difference_noise(x), quantisation_step(x) / std::sqrt(12.0));
}

double rounding_without_noise(SeriesView x) {
  if (x.size() < 5) return 0.0;
  const double step = quantisation_step(x);
  constexpr double kLeastLevels = 8.0;  // fewer are the jumps of a switched voltage, not a converter's steps
  const auto [least, most] = std::ranges::minmax_element(x);
  if (*most - *least < kLeastLevels * step) return 0.0;
  // Rounding alone shows as white noise of step/sqrt(12) = 0.29 steps, but of up to 0.9 where its errors
  // alternate from sample to sample.
  return difference_noise(x) < step ? step / std::sqrt(12.0) : 0.0;
}

}  // namespace drivebench::identification
