#pragma once

#include <string>
#include <vector>

#include "clients/command/identify/data/identify_options.hpp"
#include "clients/command/identify/suggest/suggest_design.hpp"
#include "clients/command/identify/suggest/suggest_forecast.hpp"

namespace drivebench::command {

struct SuggestReport {
  std::string motor{};
  std::string bench{};
  ExperimentLimits limits{};
  std::vector<ExperimentForecast> existing{};
  ExperimentForecast suggested{};
  bool ideal_currents = false;  ///< the bench measures them without steps and noise
  int trials = 0;
  std::string toml{};  ///< the suggested experiment
};

/// "5 A, 24 V, 100 rad/s and 0.5 s".
std::string limits_text(const ExperimentLimits& limits);
std::string suggest_text(const SuggestReport& report);
std::string suggest_json(const SuggestReport& report);

/// Searches an experiment within the limits that makes the worst interval of the bench's motor small, and
/// says what the named experiments of the motor would give.
int run_suggest(const IdentifyOptions& options);

}  // namespace drivebench::command
