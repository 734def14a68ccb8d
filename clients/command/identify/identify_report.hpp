#pragma once

#include <optional>
#include <string>

#include "clients/command/identify/data/identify_data.hpp"
#include "clients/identification/data/result.hpp"
#include "clients/identification/data/settings.hpp"
#include "clients/identification/resimulation.hpp"

namespace drivebench::command {

/// The outcome of an identification.
struct IdentifyReport {
  std::string motor;  ///< as the command line names its kind
  std::string source;
  double period_s = 0.0;
  identification::Settings settings;
  identification::Result result;
  std::optional<identification::Resimulation> validation;
  std::string validation_problem;  ///< the reason if there is no validation
  std::optional<v1::ExperimentInfo> experiment;
};

/// For a terminal: a line on the data, the table, verdict, validation and notes.
std::string identify_text(const IdentifyReport& report);

/// The same text with a Markdown table; `plot` is the picture's path relative to the file, or empty.
std::string identify_markdown(const IdentifyReport& report, const std::string& plot);

/// Measured and re-simulated currents and speed as an SVG picture, below them their differences: a panel for
/// each unit.
std::string identify_plot(const IdentifyReport& report);

}  // namespace drivebench::command
