#include "clients/identification/identify.hpp"

#include <fmt/core.h>

#include <cmath>
#include <string>

#include "clients/identification/motors/bldc_motor.hpp"
#include "clients/identification/motors/dc_motor.hpp"
#include "clients/identification/motors/induction/induction_motor.hpp"
#include "clients/identification/motors/pm_motor.hpp"
#include "clients/identification/refinement/refine.hpp"

namespace drivebench::identification {

namespace {

void check(const MeasuredData& data, const Settings& settings) {
  if (!(data.period_s > 0.0 && std::isfinite(data.period_s)))
    throw IdentificationError("the period of the data must be positive");
  if (settings.pole_pairs < 1) throw IdentificationError("pole_pairs must be 1 or more");
  if (settings.sensors.gains && settings.kind == MotorKind::kDc)
    throw IdentificationError(
        "the gains of a DC motor's sensors cannot be found: it has one current and one voltage, and another "
        "gain of either looks like another R, L, K_T and J; multiply a column by a gain that is known");
  for (const Column& column : data.columns) {
    if (column.values.size() != data.samples())
      throw IdentificationError(fmt::format("column {} has {} samples, the first one {}", column.name,
                                            column.values.size(), data.samples()));
  }
}

/// How many times its 95 % interval L_g is where the record tells it: 4 standard deviations, which noise
/// reaches in one of 16,000 records of a round rotor.
constexpr double kTellsSaliency = 4.0 / 1.96;

bool tells_saliency(const Result& salient) {
  const Estimate& l_g = *salient.find("L_g");
  return salient.explanation && salient.explanation->holds &&
         std::abs(l_g.value) > kTellsSaliency * l_g.interval.value_or(HUGE_VAL);
}

/// What the record says of a difference that it does not tell from none.
std::string round_note(const Result& salient) {
  constexpr double kClearly = 0.1;
  const Estimate& l_g = *salient.find("L_g");
  const double mean_h = 0.5 * (salient.at("L_d") + salient.at("L_q"));
  const double part = l_g.value / mean_h;
  const double interval = *l_g.interval / mean_h;
  return fmt::format("L_d and L_q are taken as one L_S: L_g = (L_d - L_q)/2 is {:.2g} % +- {:.2g} % of it{}",
                     100.0 * part, 100.0 * interval,
                     interval < kClearly ? "" : "; whether they differ a u_d that swings would tell");
}

/// The motor with the one inductance that both are taken for, each by what it tells.
Result with_one_inductance(Result salient) {
  const Estimate& d = *salient.find("L_d");
  const Estimate& q = *salient.find("L_q");
  const double weight_d = 1.0 / (*d.interval * *d.interval);
  const double weight_q = 1.0 / (*q.interval * *q.interval);
  salient.parameters.push_back({.name = "L_S",
                                .unit = "H",
                                .value = (weight_d * d.value + weight_q * q.value) / (weight_d + weight_q),
                                .truth = {}});
  return salient;
}

/// A PM synchronous motor: with L_d and L_q where the record tells their difference, else with L_S.
Result identify_either_rotor(const MeasuredData& data, const Settings& settings) {
  Result salient = identify_salient_pm_motor(data, settings);
  refine(data, settings, salient);
  if (tells_saliency(salient)) return salient;
  Result round = identify_pm_motor(data, settings);
  if (salient.excitation.sufficient) {
    const Result near = with_one_inductance(salient);
    Result begun_near = round;
    refine(data, settings, begun_near, &near);
    if (begun_near.explanation && begun_near.explanation->holds) {
      begun_near.notes.push_back(round_note(salient));
      return begun_near;
    }
  }
  refine(data, settings, round);
  const bool better = salient.explanation && round.explanation && !round.explanation->holds &&
                      salient.explanation->unlikelihood < round.explanation->unlikelihood;
  return better ? salient : round;  // refused either way: for the better reason
}

}  // namespace

Result identify_by_equations(const MeasuredData& data, const Settings& settings) {
  check(data, settings);
  switch (settings.kind) {
    case MotorKind::kDc:
      return identify_dc_motor(data, settings);
    case MotorKind::kInduction:
      return identify_induction_motor(data, settings);
    case MotorKind::kPmSynchronous:
      return identify_pm_motor(data, settings);
    case MotorKind::kBldc:
      break;
  }
  return identify_bldc_motor(data, settings);
}

Result identify(const MeasuredData& data, const Settings& settings) {
  check(data, settings);
  const bool pm = settings.kind == MotorKind::kPmSynchronous;
  if (pm && settings.rotor == Rotor::kAsTheDataSay) return identify_either_rotor(data, settings);
  Result result = pm && settings.rotor == Rotor::kSalient ? identify_salient_pm_motor(data, settings)
                                                          : identify_by_equations(data, settings);
  refine(data, settings, result);
  return result;
}

}  // namespace drivebench::identification
