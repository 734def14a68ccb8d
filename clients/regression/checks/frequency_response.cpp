#include "clients/regression/checks/frequency_response.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "plant/math/exponential.hpp"
#include "plant/math/trig.hpp"

namespace drivebench::regression {
namespace {

using Points = std::span<const ResponsePoint>;
using Quantity = double ResponsePoint::*;

/// The slope at a line over the logarithm of the frequency: that of the parabola through it and its
/// neighbours, at an end of the line to its neighbour.
double slope(Points p, Quantity y, std::size_t i) {
  const auto secant = [&](std::size_t a, std::size_t b) {
    return (p[b].*y - p[a].*y) / logarithm(p[b].hz / p[a].hz);
  };
  if (i == 0) return secant(0, 1);
  if (i + 1 == p.size()) return secant(i - 1, i);
  const double before = logarithm(p[i].hz / p[i - 1].hz);
  const double after = logarithm(p[i + 1].hz / p[i].hz);
  return (secant(i - 1, i) * after + secant(i, i + 1) * before) / (before + after);
}

/// Between line i and the next one, at the part s of the way there.
double hermite(Points p, Quantity y, std::size_t i, double s) {
  const double length = logarithm(p[i + 1].hz / p[i].hz);
  const double rest = 1.0 - s;
  return p[i].*y * (1.0 + 2.0 * s) * rest * rest + p[i + 1].*y * (3.0 - 2.0 * s) * s * s +
         length * (slope(p, y, i) * s * rest * rest - slope(p, y, i + 1) * s * s * rest);
}

ResponseAt between(Points p, std::size_t i, double s) {
  return {.hz = p[i].hz * power(p[i + 1].hz / p[i].hz, s),
          .gain_db = hermite(p, &ResponsePoint::gain_db, i, s),
          .phase_deg = hermite(p, &ResponsePoint::phase_deg, i, s)};
}

/// The place between line i and the next where the quantity has the value, which lies between those there.
ResponseAt crossing(Points p, Quantity y, std::size_t i, double value) {
  const bool rises = p[i + 1].*y > p[i].*y;
  double low = 0.0;
  double high = 1.0;
  for (int halving = 0; halving < 50; ++halving) {
    const double middle = 0.5 * (low + high);
    ((hermite(p, y, i, middle) > value) == rises ? high : low) = middle;
  }
  return between(p, i, 0.5 * (low + high));
}

/// Calls see(place) wherever the quantity crosses the value.
template <class See>
void for_each_crossing(Points p, Quantity y, double value, See see) {
  for (std::size_t i = 0; i + 1 < p.size(); ++i) {
    if ((p[i].*y > value) != (p[i + 1].*y > value)) see(crossing(p, y, i, value));
  }
}

/// Within -180 (excluded) to 180.
double wrapped(double deg) {
  return deg - 360.0 * std::ceil((deg - 180.0) / 360.0);
}

}  // namespace

std::vector<ResponsePoint> readable(Points points) {
  std::vector<ResponsePoint> kept;
  std::ranges::copy_if(points, std::back_inserter(kept), [](const ResponsePoint& p) {
    return std::isfinite(p.gain_db) && p.error <= kLargestResponseError;
  });
  return kept;
}

void unwrap(std::span<ResponsePoint> points) noexcept {
  double before = -90.0;
  for (ResponsePoint& p : points) {
    p.phase_deg = before + wrapped(p.phase_deg - before);
    if (p.error <= kLargestResponseError) before = p.phase_deg;
  }
}

std::optional<ResponseAt> response_at(Points p, double hz) {
  const auto after = std::ranges::upper_bound(p, hz, {}, &ResponsePoint::hz);
  if (p.empty() || after == p.begin() || hz > p.back().hz) return std::nullopt;
  if (after == p.end()) {
    return ResponseAt{.hz = hz, .gain_db = p.back().gain_db, .phase_deg = p.back().phase_deg};
  }
  const auto i = static_cast<std::size_t>(after - p.begin()) - 1;
  return between(p, i, logarithm(hz / p[i].hz) / logarithm(p[i + 1].hz / p[i].hz));
}

LoopMargins margins_of(Points p) {
  LoopMargins margins;
  for_each_crossing(p, &ResponsePoint::gain_db, 0.0, [&](const ResponseAt& at) {
    const double margin_deg = wrapped(180.0 + at.phase_deg);
    if (margins.crossover && margin_deg >= margins.phase_margin_deg) return;
    margins.crossover = at;
    margins.phase_margin_deg = margin_deg;
  });
  const auto [least, most] = std::ranges::minmax_element(p, {}, &ResponsePoint::phase_deg);
  if (p.empty()) return margins;
  const double first = -180.0 + 360.0 * std::ceil((least->phase_deg + 180.0) / 360.0);
  for (double reversal_deg = first; reversal_deg <= most->phase_deg; reversal_deg += 360.0) {
    for_each_crossing(p, &ResponsePoint::phase_deg, reversal_deg, [&](const ResponseAt& at) {
      if (margins.reversal && std::abs(at.gain_db) >= std::abs(margins.gain_margin_db)) return;
      margins.reversal = at;
      margins.gain_margin_db = -at.gain_db;
    });
  }
  return margins;
}

}  // namespace drivebench::regression
