#pragma once

#include <optional>
#include <string>

#include "clients/command/identify/data/identify_options.hpp"

namespace drivebench::command {

/// R_S and T_R of a running induction motor, from the samples of a bench or from a file.
struct TrackOptions {
  IdentifyOptions data{};  ///< link, axis and --from with its facts
  bool json = false;
  std::string motor_file{};  ///< of configs/motors, for the inductances
  std::optional<double> stator_inductance_h{};
  std::optional<double> leakage{};  ///< sigma
  double window_s = 0.2;            ///< that an estimate goes by
  double stride_s = 0.1;            ///< between two estimates
  double duration_s = 0.0;          ///< of the bench's time; 0: until interrupted
  double cutoff_hz = 100.0;         ///< of all filters
  std::string plot_file{};
};
int run_track(const TrackOptions& options);

}  // namespace drivebench::command
