#include "clients/command/identify/classical/classical.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/output.hpp"
#include "clients/command/common/session/session.hpp"
#include "clients/command/identify/classical/classical_report.hpp"
#include "clients/command/identify/data/identify_data.hpp"
#include "clients/command/identify/data/identify_server.hpp"
#include "clients/command/identify/data/identify_steps.hpp"

namespace drivebench::command {
namespace {

using identification::Feed;
using identification::IdentificationError;
using identification::MotorName;
using identification::NamedExperiment;
using identification::Settings;
using identification::TerminalReading;
using identification::TerminalTest;
using Truth = std::map<std::string, double, std::less<>>;

constexpr std::array kTests = {TerminalTest::kDcResistance, TerminalTest::kNoLoad,
                               TerminalTest::kBlockedRotor};
/// A held rotor turns slower than this part of the field, one without load slips less than that part.
constexpr double kMostHeldSpeed = 0.01;
constexpr double kMostNoLoadSlip = 0.05;

void refuse_options(const IdentifyOptions& o, const NamedExperiment& chosen) {
  const bool all = chosen.test == TerminalTest::kAll;
  const auto refuse = [&](bool given, const char* option, const char* why) {
    if (given)
      throw UsageError(fmt::format("{} does not go with --experiment {}: {}", option, chosen.name, why));
  };
  refuse(!o.plot_file.empty(), "--plot", "a steady state has nothing to re-simulate");
  refuse(!o.find.empty(), "--find", "a mean over periods shows no error of the sensors");
  refuse(o.current_hz || o.voltage_hz || o.shaft_hz || o.order, "a filter",
         "means over whole periods need none");
  refuse(!o.load.empty() || o.one_stage, "--load or --one-stage", "the test has no equation of motion");
  refuse(!all && !o.motor_file.empty(), "--motor-file", "one test does not give every parameter");
  refuse(all && !o.data_file.empty(), "--data", "it makes three records; run the tests one by one");
  refuse(all && !o.window.empty(), "--window", "it reads three records; run the tests one by one");
  refuse(o.stator_resistance_ohm && (all || chosen.test == TerminalTest::kDcResistance),
         "--stator-resistance", "the test with DC measures it");
  refuse(!o.from_file.empty() && !o.bench.empty(), "--bench", "--from reads data that are there");
  refuse(o.from_file.empty() && (!o.maps.empty() || !o.time.empty() || o.period_s || !o.axis.empty()),
         "--map, --time, --period or --axis", "they belong to --from");
}

MeasuredMotor measured(const IdentifyOptions& options, const MotorName& motor, const NamedExperiment& test) {
  if (!options.from_file.empty()) return read_measurement(options, motor);
  return measure(options, wanted_experiment(motor, &test, {}));
}

Settings settings_of_test(const IdentifyOptions& options, const NamedExperiment& test,
                          const MeasuredMotor& m) {
  Settings e = settings_of(identification::MotorKind::kInduction, m.facts, m.data.period_s);
  if (m.drive.empty()) e.processing.voltage_shift = 0.0;  // of a line
  if (options.from_file.empty()) apply(test, e);
  if (m.bench.empty()) e.counts_per_revolution = 0.0;
  apply_options(options, e);
  return e;
}

/// Throws if the shaft does not do what the test is about.
void check_shaft(const TestRun& run) {
  if (!run.slip) return;
  if (run.test == TerminalTest::kBlockedRotor && std::abs(1.0 - *run.slip) > kMostHeldSpeed)
    throw IdentificationError(
        fmt::format("the rotor turns at {:.3g} of the field's speed; it must be held", 1.0 - *run.slip));
  if (run.test == TerminalTest::kNoLoad && std::abs(*run.slip) > kMostNoLoadSlip)
    throw IdentificationError(
        fmt::format("the slip is {:.3g}; a motor without load that has run up slips by less than {:g}",
                    *run.slip, kMostNoLoadSlip));
}

TestRun run_of(const IdentifyOptions& options, const NamedExperiment& test, MeasuredMotor m) {
  try {
    const Settings e = settings_of_test(options, test, m);
    TestRun run{.test = test.test,
                .name = std::string(test.name),
                .source = m.source,
                .reading = {},
                .slip = {},
                .slip_bound = 0.0,
                .experiment = std::move(m.experiment)};
    const Feed feed = test.test == TerminalTest::kDcResistance ? Feed::kDc : Feed::kAc;
    run.reading = read_terminals(m.data, e, feed);
    const bool pole_pairs_known = !m.bench.empty() || options.pole_pairs;
    if (feed == Feed::kAc && run.reading.speed_rad_s && pole_pairs_known) {
      const double field_rad_s = 2.0 * std::numbers::pi * run.reading.meter.frequency_hz / e.pole_pairs;
      run.slip = 1.0 - *run.reading.speed_rad_s / field_rad_s;
      run.slip_bound = run.reading.speed_bound_rad_s / field_rad_s;
    }
    check_shaft(run);
    return run;
  } catch (const IdentificationError& error) {
    throw UsageError(fmt::format("{}: {}", m.source, error.what()));
  }
}

/// The files of --from: one, or that of each test in turn.
std::vector<std::string> files_of(const IdentifyOptions& options, std::size_t tests) {
  if (options.from_file.empty()) return std::vector<std::string>(tests);
  if (tests == 1) return {options.from_file};
  std::vector<std::string> files;
  for (std::size_t begin = 0; begin <= options.from_file.size();) {
    const std::size_t end = std::min(options.from_file.find(',', begin), options.from_file.size());
    files.push_back(options.from_file.substr(begin, end - begin));
    begin = end + 1;
  }
  if (files.size() == tests) return files;
  throw UsageError(
      fmt::format("--from of --experiment classical has {} files; it needs those of the tests dc-resistance, "
                  "no-load and blocked-rotor, separated by commas",
                  files.size()));
}

void add_sums(Truth& truth) {
  if (truth.contains("R_S") && truth.contains("R_R")) truth["R_S+R_R"] = truth["R_S"] + truth["R_R"];
  if (truth.contains("L_S") && truth.contains("M")) truth["L_S-M"] = truth["L_S"] - truth["M"];
}

void take_results(const IdentifyOptions& options, TerminalTest test, ClassicalReport& report) {
  const TerminalReading& first = report.runs.front().reading;
  const std::optional<double> stator_ohm = options.stator_resistance_ohm;
  switch (test) {
    case TerminalTest::kDcResistance:
      report.result = identification::dc_resistance_test(first);
      return;
    case TerminalTest::kNoLoad:
      report.result = identification::no_load_test(first);
      if (stator_ohm) report.losses = identification::no_load_losses(first, *stator_ohm, 0.0, 0.0);
      return;
    case TerminalTest::kBlockedRotor:
      report.result = identification::blocked_rotor_test(first, stator_ohm);
      return;
    case TerminalTest::kAll:
    case TerminalTest::kNone:
      break;
  }
  const identification::ClassicalTests all =
      identification::classical_tests(first, report.runs[1].reading, report.runs[2].reading);
  report.result = all.result;
  report.with_branch = all.with_branch;
  report.losses = all.losses;
}

void write_file(const std::string& path, const std::string& text) {
  Output out(path);
  out.write(text);
  out.flush();
}

}  // namespace

int run_terminal_tests(const IdentifyOptions& options, const MotorName& motor,
                       const NamedExperiment& chosen) {
  refuse_options(options, chosen);
  catch_interrupts();
  std::vector<TerminalTest> tests = {chosen.test};
  if (chosen.test == TerminalTest::kAll) tests.assign(kTests.begin(), kTests.end());
  const std::vector<std::string> files = files_of(options, tests.size());
  ClassicalReport report;
  report.experiment = chosen.name;
  Truth truth;
  identification::MotorFile motor_file;
  for (std::size_t k = 0; k < tests.size(); ++k) {
    IdentifyOptions of_test = options;
    of_test.from_file = files[k];
    const NamedExperiment& test = identification::experiment_of(tests[k]);
    MeasuredMotor m = measured(of_test, motor, test);
    if (!options.data_file.empty()) write_file(options.data_file, csv_of(m.data));
    truth = truth_of(motor.kind, m.bench);
    motor_file = {.name = (m.motor.empty() ? std::string(motor.name) : m.motor) + ", classical tests",
                  .source = "drivebench identify: " + m.source,
                  .pole_pairs = options.pole_pairs.value_or(m.facts.pole_pairs),
                  .star = options.phases.value_or(m.facts.three_phase ? 3 : 2) == 3};
    report.runs.push_back(run_of(of_test, test, std::move(m)));
  }
  try {
    take_results(options, chosen.test, report);
  } catch (const IdentificationError& error) {
    throw UsageError(error.what());
  }
  add_sums(truth);
  report.result.compare(truth);
  fmt::print("{}", options.json ? classical_json(report) + "\n" : classical_text(report));
  std::fflush(stdout);
  if (!options.markdown_file.empty()) write_file(options.markdown_file, classical_markdown(report));
  if (!report.result.excitation.sufficient) return kExitFailed;
  if (!options.motor_file.empty()) write_file(options.motor_file, to_motor_toml(report.result, motor_file));
  return kExitOk;
}

}  // namespace drivebench::command
