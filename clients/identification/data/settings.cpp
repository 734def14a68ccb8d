#include "clients/identification/data/settings.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

namespace drivebench::identification {

Processing usual_processing(MotorKind kind, double period_s) {
  const double highest_hz = 0.2 / period_s;
  const auto low_pass = [&](int order, double cutoff_hz) {
    return LowPass{.order = order, .cutoff_hz = std::min(cutoff_hz, highest_hz)};
  };
  Processing p;
  switch (kind) {
    case MotorKind::kDc:
      p.current = p.voltage = p.shaft = low_pass(2, 100.0);
      break;
    case MotorKind::kInduction:
      p.current = p.voltage = low_pass(3, 200.0);
      p.shaft = low_pass(3, 100.0);
      p.voltage_shift = 0.0;
      break;
    case MotorKind::kPmSynchronous:
    case MotorKind::kBldc:
      p.current = p.voltage = p.shaft = low_pass(3, 500.0);
      break;
  }
  return p;
}

Series measured_angle(const MeasuredData& data, const Settings& e) {
  const SeriesView measured = data.at(e.counts_per_revolution > 0.0 ? "encoder_count" : "angle_rad");
  Series angle = e.counts_per_revolution > 0.0 ? angle_of(measured, e.counts_per_revolution, e.half_count)
                                               : Series(measured.begin(), measured.end());
  if (e.reversed || e.zero_rad != 0.0) {
    for (double& x : angle)
      x = (e.reversed ? -x : x) + e.zero_rad;
  }
  return angle;
}

ShaftSignals shaft_signals(const MeasuredData& data, const Settings& e, const LowPass& filter) {
  const Processing& p = e.processing;
  const Series angle = zero_phase(measured_angle(data, e), filter, data.period_s);
  Series speed = slope_of(angle, data, p);
  Series acceleration =
      p.backward_differences ? slope_of(speed, data, p) : second_difference(angle, data.period_s);
  return {.angle = angle, .speed = std::move(speed), .acceleration = std::move(acceleration)};
}

namespace {

/// The variance of the acceleration that white noise of variance 1 in the angle makes behind a filter.
double noise_gain(const LowPass& filter, double period_s) {
  const auto half = static_cast<std::size_t>(4.0 / (filter.cutoff_hz * period_s)) + 8;
  Series impulse(2 * half + 1, 0.0);
  impulse[half] = 1.0;
  double gain = 0.0;
  for (const double value : second_difference(zero_phase(impulse, filter, period_s), period_s))
    gain += value * value;
  return gain;
}

double variance(SeriesView x) {
  double sum = 0.0;
  double squares = 0.0;
  for (const double value : x) {
    sum += value;
    squares += value * value;
  }
  const auto count = static_cast<double>(x.size());
  return squares / count - sum * sum / (count * count);
}

}  // namespace

void choose_shaft_filter(const MeasuredData& data, Settings& e) {
  Processing& p = e.processing;
  if (e.counts_per_revolution <= 0.0 || e.kind == MotorKind::kInduction || p.shaft.cutoff_hz == 0.0) return;
  constexpr double kMostNoise = 1e-3;
  constexpr double kStep = std::numbers::sqrt2;
  constexpr int kMostSteps = 12;
  const SampleRange range = window_of(data, p);
  const Series angle = measured_angle(data, e);
  const double count_rad = 2.0 * std::numbers::pi / e.counts_per_revolution;
  LowPass best = p.shaft;
  double least = std::numeric_limits<double>::infinity();
  LowPass tried = p.shaft;
  for (int step = 0; step < kMostSteps && least > kMostNoise; ++step, tried.cutoff_hz /= kStep) {
    const Series acceleration = second_difference(zero_phase(angle, tried, data.period_s), data.period_s);
    const double noise = count_rad * count_rad / 12.0 * noise_gain(tried, data.period_s);
    const double share = noise / variance(SeriesView(acceleration).subspan(range.first, range.count()));
    if (!(share < least)) continue;
    least = share;
    best = tried;
  }
  p.shaft = best;
  p.shaft_chosen = true;
  if (e.kind == MotorKind::kDc) p.current = p.voltage = best;
}

TwoPhaseSeries windings(const MeasuredData& data, const Settings& e, char quantity, char unit) {
  const auto column = [&](char phase) { return data.at(fmt::format("{}_{}_{}", quantity, phase, unit)); };
  const SeriesView a = column('a');
  const SeriesView b = column('b');
  if (e.three_phase) return two_phase(a, b, column('c'));
  return {.a = {a.begin(), a.end()}, .b = {b.begin(), b.end()}};
}

SampleRange window_of(const MeasuredData& data, const Processing& p) {
  const double rate_hz = 1.0 / data.period_s;
  const auto sample_at = [&](double time_s) {
    return static_cast<std::size_t>(
        std::clamp(std::round(time_s * rate_hz), 0.0, static_cast<double>(data.samples())));
  };
  const std::size_t last = data.samples() - std::min(data.samples(), p.edge_samples);
  const std::size_t first = std::max(p.edge_samples, sample_at(p.from_s));
  const std::size_t end = p.to_s > 0.0 ? std::min(last, sample_at(p.to_s)) : last;
  constexpr std::size_t kLeast = 50;
  if (end < first + kLeast)
    throw IdentificationError(
        fmt::format("{} samples of the record's {} lie in the window, at least {} are needed",
                    end > first ? end - first : 0, data.samples(), kLeast));
  return {.first = first, .end = end};
}

bool varies(SeriesView x, const SampleRange& range) {
  double sum = 0.0;
  double squares = 0.0;
  for (const double value : x.subspan(range.first, range.count()))
    sum += value;
  const double mean = sum / static_cast<double>(range.count());
  double spread = 0.0;
  for (const double value : x.subspan(range.first, range.count())) {
    squares += value * value;
    spread += (value - mean) * (value - mean);
  }
  constexpr double kLeast = 2e-3;
  return spread > kLeast * kLeast * squares;
}

void expect_positive(Result& result, const std::vector<std::string>& names) {
  for (const std::string& name : names) {
    if (!(result.at(name) > 0.0)) add_unseen(result.excitation, {name}, name + " comes out as zero or less");
  }
}

Series slope_of(SeriesView x, const MeasuredData& data, const Processing& p) {
  return p.backward_differences ? backward_difference(x, data.period_s)
                                : central_difference(x, data.period_s);
}

}  // namespace drivebench::identification
