#pragma once

#include <vector>

#include "clients/identification/motors/terminal_voltages.hpp"

namespace drivebench::identification {

/// The errors of the sensors, white, rms.
struct SensorNoise {
  double voltage_v = 0.0;
  double current_a = 0.0;
  double angle_rad = 0.0;

  bool operator==(const SensorNoise&) const = default;
};

/// What the predictor needs of a record.
struct PredictorRecord {
  TerminalVoltages voltages;
  std::vector<Series> currents;  ///< of each phase
  Series angle;                  ///< of the shaft as measured [rad]
  SampleRange range;             ///< samples that are predicted
  double period_s;
  double pole_pairs;
  double first_speed;        ///< [rad/s]
  double largest_current_a;  ///< in the record
  double largest_speed;      ///< [rad/s]
  std::size_t still = 0;     ///< first samples of the range in which the encoder shows one count
  bool from_rest = false;    ///< the first sample of the range has no flux, current or speed
};

/// No model is better than this part of the largest current.
inline constexpr double kLeastCurrent = 1e-4;

/// The window of a record, its first Settings::most_samples samples.
PredictorRecord record_of(const MeasuredData& data, const Settings& settings);

/// The same from its first sample on, if that is a motor at rest.
PredictorRecord from_rest(PredictorRecord record, const MeasuredData& data, const Settings& settings);

/// Every `by`-th sample of the range of a record.
PredictorRecord thinned(const PredictorRecord& record, std::size_t by);

/// Every how many-th sample is enough for a rough fit: some thousand, not so far apart that the currents of
/// line or rotor turn much between them.
std::size_t rough_step(const PredictorRecord& record);

/// The noises before a model has explained anything: of the currents their white part, of the angle that of
/// its counts, of the voltages a fiftieth.
SensorNoise first_noise(const PredictorRecord& record, const Settings& settings);

}  // namespace drivebench::identification
