#include "clients/command/identify/suggest/suggest.hpp"

#include <fmt/core.h>

#include <cmath>
#include <string>
#include <string_view>
#include <utility>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/output.hpp"
#include "clients/command/common/session/session.hpp"
#include "clients/command/identify/data/identify_steps.hpp"
#include "clients/identification/math/pattern_search.hpp"

namespace drivebench::command {
namespace {

using identification::MotorName;
using identification::NamedExperiment;

/// Scores of trials that are no candidates, worse than any interval: the search still sees which is nearer.
constexpr double kUnused = 1e3;
constexpr double kBeyondLimits = 1e6;

void check_suggest(const IdentifyOptions& o) {
  if (!o.from_file.empty())
    throw UsageError("--suggest tries experiments on a bench; --from reads what was measured");
  if (!o.experiment.empty())
    throw UsageError("--suggest makes an experiment; --experiment runs one that there is");
  if (o.link_was_named)
    throw UsageError(
        "--suggest tries experiments on a server of its own; --bench names the bench in the place of --link");
  if (!o.markdown_file.empty() || !o.plot_file.empty() || !o.motor_file.empty() || !o.data_file.empty())
    throw UsageError(
        "--suggest writes an experiment, to --suggest-file; identify it for report, plot, motor file and "
        "data");
}

double limit_of(const std::optional<double>& chosen, const MeasuredMotor& m, std::string_view parameter,
                const char* option) {
  const auto found = m.bench.find(parameter);
  const double limit = chosen ? *chosen : found == m.bench.end() ? 0.0 : found->second;
  if (!(limit > 0.0))
    throw UsageError(fmt::format("{} is missing: the bench has no {} above 0", option, parameter));
  return limit;
}

ExperimentLimits limits_of(const IdentifyOptions& options, const MotorName& motor, const MeasuredMotor& m) {
  const SuggestOptions& o = options.suggestion;
  const bool source = m.drive == "source";
  const NamedExperiment& first = *identification::first_experiment(motor.name);
  return {.current_a = limit_of(o.current_a, m, "amplifier.over_current_a", "--max-current"),
          .voltage_v = limit_of(o.voltage_v, m, source ? "source.amplitude_v" : "amplifier.voltage_limit_v",
                                "--max-voltage"),
          .speed_rad_s = o.speed_rad_s.value_or(0.0),
          .duration_s =
              o.duration_s ? *o.duration_s : wanted_experiment(motor, &first, {}).file.request.duration_s()};
}

/// A family of experiments has frequencies between 1/duration and a twentieth of the sample rate.
void check_duration(double duration_s, double period_s) {
  constexpr double kFewest = 100.0;
  if (duration_s < kFewest * period_s)
    throw UsageError(
        fmt::format("--seconds {:g} is too short: an experiment has {:g} samples of {:g} s at least",
                    duration_s, kFewest, period_s));
}

/// Refuses limits that the gentlest experiment of a family exceeds: no other stays within them.
void check_limits(const ExperimentLimits& limits, const ExperimentForecast& gentlest) {
  std::string reasons;
  const auto compare = [&reasons](const char* option, double limit, double used, const char* unit) {
    if (!(limit > 0.0) || used <= limit) return;
    reasons += fmt::format("{}{} {:g} cannot be kept: the gentlest experiment takes {:.3g} {}",
                           reasons.empty() ? "" : "; ", option, limit, used, unit);
  };
  compare("--max-current", limits.current_a, gentlest.current_a, "A");
  compare("--max-voltage", limits.voltage_v, gentlest.voltage_v, "V");
  compare("--max-speed", limits.speed_rad_s, gentlest.speed_rad_s, "rad/s");
  if (!reasons.empty())
    throw UsageError(reasons + ", as the sensors show it with their noise; raise the limit well above that");
}

double score_of(const ExperimentForecast& forecast) {
  if (forecast.limit_used > 1.0) return kBeyondLimits * forecast.limit_used;
  return std::isfinite(forecast.worst) ? forecast.worst : kUnused;
}

std::string trial_text(const ExperimentForecast& forecast) {
  if (!forecast.problem.empty()) return forecast.problem;
  if (forecast.limit_used > 1.0) return fmt::format("{:.3g} times a limit", forecast.limit_used);
  if (!std::isfinite(forecast.worst)) return "no motor follows it";
  return fmt::format("{} within {:.3g} %", forecast.worst_name, 100.0 * forecast.worst);
}

class Suggestion {
 public:
  Suggestion(const IdentifyOptions& options, const MotorName& motor)
      : options_(options),
        motor_(motor),
        bench_(options.bench.empty() ? identification::first_experiment(motor.name)->bench : options.bench),
        forecasts_(options, motor, bench_) {
    report_.motor = motor.name;
    report_.bench = bench_;
  }

  SuggestReport made() {
    WantedExperiment base;
    base.file.axis = options_.axis.empty() ? "0" : options_.axis;
    base.file.request.set_label("suggested");
    base.file.request.set_mode(v1::MODE_FREE);
    base.file.request.add_signals("speed_rad_s");
    MeasuredMotor known = forecasts_.prepare(base);
    report_.limits = limits_of(options_, motor_, known);
    check_duration(report_.limits.duration_s, known.data.period_s);
    report_.ideal_currents =
        known.bench["current_sensor.bits"] == 0.0 && known.bench["current_sensor.noise_rms_a"] == 0.0;
    const ExperimentDesign design =
        design_for(motor_, known.drive, known.bench, report_.limits, known.data.period_s);
    check_limits(report_.limits, forecasts_.measured(excited(base, design, gentlest(design))));
    try_existing();

    Progress progress("suggest");
    const auto score = [&](const std::vector<double>& at) {
      const ExperimentForecast forecast = tried(excited(base, design, at));
      ++report_.trials;
      progress.update(static_cast<double>(report_.trials) / options_.suggestion.trials, trial_text(forecast));
      return score_of(forecast);
    };
    const std::vector<double> best =
        pattern_search(design.variables, {.most_trials = options_.suggestion.trials}, score);
    const WantedExperiment suggested = excited(base, design, best);
    report_.suggested = tried(suggested);
    report_.toml = toml_of(suggested, design);
    return std::move(report_);
  }

 private:
  /// What the named experiments of the motor tell on this bench, with their own settings.
  void try_existing() {
    for (const NamedExperiment& each : identification::named_experiments()) {
      if (each.motor != motor_.name || each.test != identification::TerminalTest::kNone) continue;
      WantedExperiment wanted = wanted_experiment(motor_, &each, {});
      if (each.bench != bench_) wanted.file.axis = options_.axis.empty() ? "0" : options_.axis;
      report_.existing.push_back(forecasts_.run(std::string(each.name), wanted, &each));
      use_limits(report_.limits, report_.existing.back());
    }
  }

  WantedExperiment excited(WantedExperiment base, const ExperimentDesign& design,
                           const std::vector<double>& at) const {
    v1::RunExperiment& request = base.file.request;
    request.set_duration_s(report_.limits.duration_s);
    design.excite(at, request);
    return base;
  }

  ExperimentForecast tried(const WantedExperiment& experiment) {
    ExperimentForecast forecast = forecasts_.run("suggested", experiment, nullptr);
    use_limits(report_.limits, forecast);
    return forecast;
  }

  std::string toml_of(WantedExperiment suggested, const ExperimentDesign& design) const {
    const ExperimentLimits& limits = report_.limits;
    v1::StopLimits& stop = *suggested.file.request.mutable_stop();
    stop.set_current_a(limits.current_a);
    stop.set_speed_rad_s(limits.speed_rad_s);
    return to_toml(
        suggested.file,
        fmt::format("{}\nSuggested by drivebench for the bench {}, within {}: worst interval {:.2g} % ({}).",
                    design.sentence, report_.bench, limits_text(limits), 100.0 * report_.suggested.worst,
                    report_.suggested.worst_name));
  }

  const IdentifyOptions& options_;
  const MotorName& motor_;
  std::string bench_;
  Forecasts forecasts_;
  SuggestReport report_;
};

}  // namespace

int run_suggest(const IdentifyOptions& options) {
  const MotorName& motor = chosen_motor(options.motor);
  check_suggest(options);
  catch_interrupts();
  const SuggestReport report = Suggestion(options, motor).made();
  fmt::print("{}", options.json ? suggest_json(report) + "\n" : suggest_text(report));
  if (options.suggestion.file.empty()) {
    if (!options.json) fmt::print("\n{}", report.toml);
  } else {
    Output out(options.suggestion.file);
    out.write(report.toml);
    out.flush();
  }
  return report.suggested.result.excitation.sufficient && report.suggested.limit_used <= 1.0 ? kExitOk
                                                                                             : kExitFailed;
}

}  // namespace drivebench::command
