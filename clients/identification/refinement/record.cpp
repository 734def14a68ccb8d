#include "clients/identification/refinement/record.hpp"

#include <algorithm>
#include <numbers>
#include <string>

#include "clients/identification/data/noise.hpp"

namespace drivebench::identification {
namespace {

std::size_t still_samples(const PredictorRecord& r, const Settings& e) {
  if (e.counts_per_revolution <= 0.0) return 0;
  const auto first = r.angle.begin() + static_cast<std::ptrdiff_t>(r.range.first);
  const auto end = r.angle.begin() + static_cast<std::ptrdiff_t>(r.range.end);
  return static_cast<std::size_t>(std::find_if(first, end, [&](double a) { return a != *first; }) - first);
}

}  // namespace

PredictorRecord record_of(const MeasuredData& data, const Settings& e) {
  PredictorRecord r{.voltages = {data, e},
                    .currents = {},
                    .angle = {},
                    .range = window_of(data, e.processing),
                    .period_s = data.period_s,
                    .pole_pairs = static_cast<double>(e.pole_pairs),
                    .first_speed = 0.0,
                    .largest_current_a = 0.0,
                    .largest_speed = 0.0};
  r.range.end = std::min(r.range.end, r.range.first + e.most_samples);
  const ShaftSignals shaft = shaft_signals(data, e, e.processing.shaft);
  for (std::size_t k = 0; k < r.voltages.phases(); ++k) {
    const SeriesView current = data.at("i_" + std::string(1, static_cast<char>('a' + k)) + "_a");
    r.currents.emplace_back(current.begin(), current.end());
    r.largest_current_a = std::max(r.largest_current_a, largest(r.currents.back()));
  }
  r.angle = measured_angle(data, e);
  r.largest_speed = largest(shaft.speed);
  r.first_speed = shaft.speed[r.range.first];
  r.still = still_samples(r, e);
  return r;
}

PredictorRecord from_rest(PredictorRecord record, const MeasuredData& data, const Settings& e) {
  const ShaftSignals shaft = shaft_signals(data, e, e.processing.shaft);
  const std::vector<SeriesView> currents(record.currents.begin(), record.currents.end());
  if (!begins_at_rest(currents, shaft.speed)) return record;
  record.range.first = 0;
  record.first_speed = shaft.speed[0];
  record.from_rest = true;
  record.still = still_samples(record, e);
  return record;
}

PredictorRecord thinned(const PredictorRecord& record, std::size_t by) {
  const auto thin = [&](const Series& x) {
    Series kept;
    for (std::size_t k = record.range.first; k < record.range.end; k += by)
      kept.push_back(x[k]);
    return kept;
  };
  PredictorRecord r = record;
  r.voltages = record.voltages.thinned(record.range.first, by);
  std::ranges::transform(record.currents, r.currents.begin(), thin);
  r.angle = thin(record.angle);
  r.range = {0, r.angle.size()};
  r.period_s *= static_cast<double>(by);
  r.still = (record.still + by - 1) / by;
  return r;
}

std::size_t rough_step(const PredictorRecord& record) {
  constexpr std::size_t kRoughSamples = 5000;
  constexpr double kLongestPeriod_s = 0.25e-3;
  constexpr double kMostTurn_rad = 0.3;
  const double speed = std::max(record.pole_pairs * record.largest_speed, kMostTurn_rad / kLongestPeriod_s);
  const auto most = static_cast<std::size_t>(kMostTurn_rad / (speed * record.period_s) * (1.0 + 1e-9));
  return std::clamp<std::size_t>(record.range.count() / kRoughSamples, 1, std::max<std::size_t>(most, 1));
}

SensorNoise first_noise(const PredictorRecord& r, const Settings& e) {
  constexpr double kFirstVoltage = 0.02;  // of the rms voltage: what the first round allows
  SensorNoise noise{.voltage_v = kFirstVoltage * r.voltages.rms(r.range), .current_a = 0.0, .angle_rad = 0.0};
  for (const SeriesView i : r.currents)
    noise.current_a = std::max(noise.current_a, white_noise(i.subspan(r.range.first, r.range.count())));
  noise.current_a = std::max(noise.current_a, kLeastCurrent * r.largest_current_a);
  noise.angle_rad =
      e.counts_per_revolution > 0.0
          ? 2.0 * std::numbers::pi / e.counts_per_revolution / std::sqrt(12.0)
          : std::max(1e-6, white_noise(SeriesView(r.angle).subspan(r.range.first, r.range.count())));
  return noise;
}

}  // namespace drivebench::identification
