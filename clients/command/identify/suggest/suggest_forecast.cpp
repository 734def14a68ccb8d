#include "clients/command/identify/suggest/suggest_forecast.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/session/session.hpp"
#include "clients/command/identify/data/identify_steps.hpp"
#include "clients/identification/identify.hpp"
#include "clients/link/common/requests.hpp"

namespace drivebench::command {
namespace {

using identification::Column;
using identification::Estimate;
using identification::IdentificationError;
using identification::MotorName;
using identification::NamedExperiment;

/// The choice of drive.kind.
constexpr double kVoltageAmplifier = 0.0;

double largest_of(identification::SeriesView values) {
  double most = 0.0;
  for (const double value : values)
    most = std::max(most, std::abs(value));
  return most;
}

/// The largest magnitude in the columns of a quantity: "i", "a" of i_a_a, i_b_a, i_c_a.
double largest_phase(const identification::MeasuredData& data, char quantity, char unit) {
  double most = 0.0;
  for (const char phase : {'a', 'b', 'c'}) {
    const Column* const column = data.find(fmt::format("{}_{}_{}", quantity, phase, unit));
    if (column != nullptr) most = std::max(most, largest_of(column->values));
  }
  return most;
}

/// Puts the worst parameter that the motor has into the forecast.
void find_worst(ExperimentForecast& forecast) {
  forecast.worst = 0.0;
  for (const Estimate& e : forecast.result.parameters) {
    if (!counts(e)) continue;
    const double open = e.interval ? std::max(*e.interval, std::abs(e.value - *e.truth)) : HUGE_VAL;
    if (!(open > forecast.worst * std::abs(*e.truth))) continue;
    forecast.worst = open / std::abs(*e.truth);
    forecast.worst_name = e.name;
  }
}

}  // namespace

bool counts(const Estimate& e) noexcept {
  const bool of_regression = e.name.size() > 1 && e.name[0] == 'K' && e.name[1] >= '0' && e.name[1] <= '9';
  return !of_regression && e.truth && *e.truth != 0.0;
}

void use_limits(const ExperimentLimits& limits, ExperimentForecast& forecast) {
  forecast.limit_used =
      std::max(forecast.current_a / limits.current_a, forecast.voltage_v / limits.voltage_v);
  if (limits.speed_rad_s > 0.0)
    forecast.limit_used = std::max(forecast.limit_used, forecast.speed_rad_s / limits.speed_rad_s);
}

Forecasts::Forecasts(const IdentifyOptions& options, const MotorName& motor, const std::string& bench)
    : options_(options), motor_(motor), bench_(bench) {
  options_.json = true;  // a trial says nothing
}

MeasuredMotor Forecasts::prepare(WantedExperiment& experiment) const {
  MeasuredMotor known = bench_.describe(experiment);
  if (!identification::is_machine_of(known.machine, motor_.machine))
    throw UsageError(fmt::format("the bench has a motor of kind {}, --motor {} is for {}", known.machine,
                                 motor_.name, motor_.machine));
  if (known.drive == "source") return known;
  const auto set = [&](const char* name, double value) {
    const auto found = known.bench.find(name);
    if (found != known.bench.end() && found->second == value) return;
    v1::NamedValue& setting = *experiment.file.request.add_settings();
    setting.set_name(name);
    setting.set_value(value);
  };
  if (known.drive != "voltage_amplifier") set("drive.kind", kVoltageAmplifier);
  set("amplifier.delay_ticks", 0.0);
  set("amplifier.filter_hz", 0.0);
  return bench_.describe(experiment);
}

/// Runs an experiment and puts what it uses into the forecast.
MeasuredMotor Forecasts::take(WantedExperiment wanted, ExperimentForecast& forecast) const {
  auto& signals = *wanted.file.request.mutable_signals();
  if (std::ranges::find(signals, "speed_rad_s") == signals.end()) *signals.Add() = "speed_rad_s";
  MeasuredMotor m = bench_.measure(options_, wanted);
  if (interrupted()) throw std::runtime_error("interrupted");
  forecast.current_a = largest_phase(m.data, 'i', 'a');
  forecast.voltage_v = largest_phase(m.data, 'u', 'v');
  forecast.speed_rad_s = largest_of(m.data.at("speed_rad_s"));
  return m;
}

ExperimentForecast Forecasts::measured(WantedExperiment wanted) const {
  ExperimentForecast forecast;
  try {
    take(std::move(wanted), forecast);
  } catch (const link::RefusalError& error) {
    forecast.problem = error.what();
  }
  return forecast;
}

ExperimentForecast Forecasts::run(std::string name, WantedExperiment wanted,
                                  const NamedExperiment* named) const {
  ExperimentForecast forecast{.name = std::move(name)};
  try {
    const MeasuredMotor m = take(std::move(wanted), forecast);
    identification::Settings settings = settings_for(options_, motor_, named, m);
    const bool round = truth_of(motor_.kind, m.bench).contains("L_S");
    settings.rotor = round ? identification::Rotor::kRound : identification::Rotor::kSalient;
    forecast.result = identify(m.data, settings);
    compare(m, settings, forecast.result);
    if (forecast.result.explanation) find_worst(forecast);
  } catch (const IdentificationError& error) {
    forecast.problem = error.what();
  } catch (const link::RefusalError& error) {
    forecast.problem = error.what();
  }
  return forecast;
}

}  // namespace drivebench::command
