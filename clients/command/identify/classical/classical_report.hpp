#pragma once

#include <optional>
#include <string>
#include <vector>

#include "clients/command/identify/data/identify_data.hpp"
#include "clients/identification/motors/classical_tests.hpp"
#include "clients/identification/named_experiments.hpp"

namespace drivebench::command {

/// A test that was made, and its reading.
struct TestRun {
  identification::TerminalTest test = identification::TerminalTest::kNone;
  std::string name;    ///< of the experiment
  std::string source;  ///< one line for people
  identification::TerminalReading reading;
  std::optional<double> slip;  ///< as the shaft shows it; nothing with DC and without a shaft in the record
  double slip_bound = 0.0;     ///< what the steps of the encoder leave open of it
  std::optional<v1::ExperimentInfo> experiment;
};

/// The outcome of tests at the terminals.
struct ClassicalReport {
  std::string experiment;  ///< as the command line names it
  std::vector<TestRun> runs;
  identification::Result result;
  std::optional<identification::TestedMotor> with_branch;  ///< of all three tests
  std::optional<identification::NoLoadLosses> losses;      ///< where R_S and a no-load test are known
};

/// The structural error of an estimate in parts of the value with the magnetising branch; nothing for
/// parameters without one.
std::optional<double> structural_error(const ClassicalReport& report,
                                       const identification::Estimate& estimate);

std::string classical_text(const ClassicalReport& report);
std::string classical_markdown(const ClassicalReport& report);
/// The result as identify_json() has it, with `readings`, `structural` and `losses`.
std::string classical_json(const ClassicalReport& report);

}  // namespace drivebench::command
