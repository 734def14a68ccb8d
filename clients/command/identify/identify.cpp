#include "clients/command/identify/identify.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>
#include <vector>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/output.hpp"
#include "clients/command/common/basics/text.hpp"
#include "clients/command/common/programs/installation.hpp"
#include "clients/command/common/session/session.hpp"
#include "clients/command/identify/classical/classical.hpp"
#include "clients/command/identify/data/identify_data.hpp"
#include "clients/command/identify/data/identify_server.hpp"
#include "clients/command/identify/data/identify_steps.hpp"
#include "clients/command/identify/identify_json.hpp"
#include "clients/command/identify/identify_report.hpp"
#include "clients/command/identify/suggest/suggest.hpp"
#include "clients/identification/find_wiring.hpp"
#include "clients/identification/identify.hpp"
#include "clients/identification/motors/motors.hpp"
#include "clients/identification/named_experiments.hpp"
#include "protocols/document.hpp"
#include "protocols/nearest_name.hpp"
#include "protocols/text.hpp"

namespace drivebench::command {
namespace {

using identification::GivenWiring;
using identification::IdentificationError;
using identification::LoadModel;
using identification::MotorKind;
using identification::MotorName;
using identification::NamedExperiment;
using identification::Settings;
using identification::WiringFact;

int print_list(bool json) {
  if (json) {
    fmt::print("{}\n", named_experiments_json());
    return kExitOk;
  }
  for (const MotorName& motor : identification::kMotorNames) {
    fmt::print("--motor {:<6} {}\n", motor.name, motor.meaning);
    for (const NamedExperiment& each : identification::named_experiments()) {
      if (each.motor == motor.name)
        fmt::print("    --experiment {:<15} {}; bench {}\n", each.name, each.summary, each.bench);
    }
  }
  return kExitOk;
}

/// The chosen experiment; null for a file of the user.
const NamedExperiment* chosen_experiment(const MotorName& motor, const std::string& choice) {
  for (const NamedExperiment& each : identification::named_experiments()) {
    if (each.motor == motor.name && (choice.empty() || each.name == choice)) return &each;
  }
  if (choice.ends_with(".toml")) return nullptr;
  std::vector<std::string_view> known;
  for (const NamedExperiment& each : identification::named_experiments()) {
    if (each.motor == motor.name) known.push_back(each.name);
  }
  throw UsageError(fmt::format(
      "--experiment '{}' is not known for --motor {}{}; there are {}, and files that end with .toml",
      printable(choice), motor.name, did_you_mean(choice, known),
      identification::experiment_names(motor.name)));
}

MeasuredMotor measured_motor(const IdentifyOptions& options, const MotorName& motor,
                             const NamedExperiment* named) {
  if (options.from_file.empty()) return measure(options, wanted_experiment(motor, named, options.experiment));
  return read_measurement(options, motor);
}

void check_foreign(const IdentifyOptions& options, const MeasuredMotor& m) {
  if (!m.bench.empty()) return;
  const bool counts = m.data.find("encoder_count") != nullptr;
  if (counts && !options.counts_per_revolution && m.data.find("angle_rad") == nullptr)
    throw UsageError("--counts is missing: how many counts of encoder_count are a revolution");
}

/// Finds the wiring of a record. A bench knows its own, except where its voltages belong to no instant.
std::vector<WiringFact> wiring_of(const IdentifyOptions& options, const MeasuredMotor& m, Settings& e) {
  const bool bench = !m.bench.empty();
  const GivenWiring given = {
      .pole_pairs = bench || options.pole_pairs,
      .direction = bench || !options.direction.empty(),
      .voltage_shift = !m.drive.empty() || !options.voltages.empty() || options.voltage_shift,
      .zero = bench,
      .by_bench = bench};
  std::vector<WiringFact> wiring = find_wiring(m.data, e, given);
  for (const WiringFact& fact : wiring) {
    if (fact.name == "pole_pairs" && !fact.found && !given.pole_pairs)
      throw UsageError("--pole-pairs is missing, and the data do not tell: " + fact.remark);
  }
  return wiring;
}

IdentifyReport identified(const IdentifyOptions& options, const MotorName& motor, MeasuredMotor m,
                          Settings e) {
  std::vector<WiringFact> wiring = wiring_of(options, m, e);
  IdentifyReport report{.motor = std::string(motor.name),
                        .source = m.source,
                        .period_s = m.data.period_s,
                        .settings = e,
                        .result = identify(m.data, e),
                        .validation = {},
                        .validation_problem = {},
                        .experiment = std::move(m.experiment)};
  report.result.wiring = std::move(wiring);
  compare(m, e, report.result);
  if (!m.facts.note.empty()) report.result.notes.push_back(m.facts.note);
  try {
    report.validation = resimulate(m.data, e, report.result);
  } catch (const IdentificationError& error) {
    report.validation_problem = error.what();
  }
  return report;
}

void write(const std::string& path, const std::string& text) {
  Output out(path);
  out.write(text);
  out.flush();
}

/// The path of the picture relative to the Markdown file.
std::string relative_plot(const IdentifyOptions& options) {
  if (options.plot_file.empty()) return {};
  const std::filesystem::path folder = std::filesystem::absolute(options.markdown_file).parent_path();
  return std::filesystem::absolute(options.plot_file).lexically_relative(folder).generic_string();
}

/// Writes the requested files. Reports a file that it cannot write after it has written the others.
int write_files(const IdentifyOptions& options, const IdentifyReport& report, const MeasuredMotor& m) {
  std::string problems;
  const auto attempt = [&](const std::string& path, const auto& text) {
    if (path.empty()) return;
    try {
      write(path, text());
    } catch (const UsageError&) {
      throw;
    } catch (const std::runtime_error& error) {
      problems += fmt::format("drivebench: {}: {}\n", path, error.what());
    }
  };
  const bool plotted = report.validation.has_value();
  attempt(options.plot_file, [&] { return identify_plot(report); });
  attempt(options.markdown_file,
          [&] { return identify_markdown(report, plotted ? relative_plot(options) : std::string()); });
  attempt(options.motor_file, [&] {
    const identification::MotorFile file = {
        .name = (m.motor.empty() ? report.motor : m.motor) + ", identified",
        .source = "drivebench identify: " + report.source,
        .pole_pairs = report.settings.pole_pairs,
        .star = report.settings.three_phase};
    return to_motor_toml(report.result, file);
  });
  fmt::print(stderr, "{}", problems);
  return problems.empty() ? kExitOk : kExitFailed;
}

void check_choice(const IdentifyOptions& options) {
  if (options.from_file.empty() &&
      (!options.maps.empty() || !options.time.empty() || options.period_s || !options.axis.empty()))
    throw UsageError("--map, --time, --period and --axis belong to --from");
  if (!options.from_file.empty() && (!options.experiment.empty() || !options.bench.empty()))
    throw UsageError("--from reads data that are there; --experiment and --bench make new ones");
  if (options.from_file.ends_with(".mcap") &&
      (!options.maps.empty() || !options.time.empty() || options.period_s))
    throw UsageError(
        "--map, --time and --period belong to CSV files; a recording has the catalogue's signals");
}

}  // namespace

int run_identify(const IdentifyOptions& options) {
  if (options.list) return print_list(options.json);
  if (options.suggest) return run_suggest(options);
  const MotorName& motor = chosen_motor(options.motor);
  const NamedExperiment* const test = identification::find_experiment(motor.name, options.experiment);
  if (test != nullptr && test->test != identification::TerminalTest::kNone)
    return run_terminal_tests(options, motor, *test);
  if (options.stator_resistance_ohm)
    throw UsageError("--stator-resistance belongs to the experiments no-load and blocked-rotor");
  check_choice(options);
  const NamedExperiment* const named =
      options.from_file.empty() ? chosen_experiment(motor, options.experiment) : nullptr;
  catch_interrupts();
  MeasuredMotor m = measured_motor(options, motor, named);
  check_foreign(options, m);
  if (!options.data_file.empty()) write(options.data_file, csv_of(m.data));
  const Settings e = settings_for(options, motor, named, m);
  IdentifyReport report;
  try {
    report = identified(options, motor, m, e);
  } catch (const IdentificationError& error) {
    throw UsageError(fmt::format("{}: {}", m.source, error.what()));
  }
  fmt::print("{}", options.json ? identify_json(report) + "\n" : identify_text(report));
  std::fflush(stdout);
  const int written = write_files(options, report, m);
  return report.result.excitation.sufficient ? written : kExitFailed;
}

}  // namespace drivebench::command
