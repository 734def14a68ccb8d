#include "clients/identification/refinement/refine.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numbers>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "clients/identification/data/noise.hpp"
#include "clients/identification/motors/bending_induction.hpp"
#include "clients/identification/refinement/bend.hpp"
#include "clients/identification/refinement/gauss_newton.hpp"
#include "clients/identification/refinement/predictor.hpp"
#include "clients/identification/refinement/sensor_unknowns.hpp"
#include "clients/identification/refinement/unknowns.hpp"
#include "clients/identification/refinement/verdict.hpp"

namespace drivebench::identification {
namespace {

constexpr double k95 = 1.96;
constexpr int kRounds = 2;              ///< of linearisation, Gauss-Newton and noise
constexpr double kFirstVoltage = 0.02;  ///< of the rms voltage: the noise that the first round allows
constexpr double kFirstCurrent = 0.01;  ///< of the largest current: the same
constexpr double kLeastCurrent = 1e-4;  ///< of the largest: no model is better
constexpr double kHopeless = 25.0;      ///< mean square of the first round's innovations, where 1 is expected
constexpr double kLargestChange = 0.7;  ///< of a logarithm in a step
/// Half of an interval, of the value. Beyond a tenth a valley of the error may bend, and the interval, which
/// is straight, does not tell how far it goes; friction and load enter linearly.
constexpr double kWidest = 0.1;
constexpr double kWidestFriction = 0.5;
constexpr double kImmaterial = 0.02;  ///< half of a friction's interval, of the torque that accelerates

PredictorRecord record_of(const MeasuredData& data, const Settings& e) {
  PredictorRecord r{.voltages = {data, e},
                    .currents = {},
                    .angle = {},
                    .range = window_of(data, e.processing),
                    .period_s = data.period_s,
                    .pole_pairs = static_cast<double>(e.pole_pairs),
                    .first_speed = 0.0,
                    .largest_current_a = 0.0,
                    .largest_speed = 0.0};
  r.range.end = std::min(r.range.end, r.range.first + e.most_samples);
  const ShaftSignals shaft = shaft_signals(data, e, e.processing.shaft);
  for (std::size_t k = 0; k < r.voltages.phases(); ++k) {
    r.currents.push_back(data.at("i_" + std::string(1, static_cast<char>('a' + k)) + "_a"));
    r.largest_current_a = std::max(r.largest_current_a, largest(r.currents.back()));
  }
  r.angle = measured_angle(data, e);
  r.largest_speed = largest(shaft.speed);
  r.first_speed = shaft.speed[r.range.first];
  return r;
}

SensorNoise first_noise(const PredictorRecord& r, const Settings& e) {
  SensorNoise noise{.voltage_v = kFirstVoltage * r.voltages.rms(r.range), .current_a = 0.0, .angle_rad = 0.0};
  for (const SeriesView i : r.currents)
    noise.current_a = std::max(noise.current_a, white_noise(i.subspan(r.range.first, r.range.count())));
  noise.current_a = std::max(noise.current_a, kLeastCurrent * r.largest_current_a);
  noise.angle_rad =
      e.counts_per_revolution > 0.0
          ? 2.0 * std::numbers::pi / e.counts_per_revolution / std::sqrt(12.0)
          : std::max(1e-6, white_noise(SeriesView(r.angle).subspan(r.range.first, r.range.count())));
  return noise;
}

/// The noises of voltages and currents that make the likelihood greatest, each to a fifth.
template <class Model>
SensorNoise likeliest(Predictor<Model>& predictor, const Model& model, SensorNoise noise,
                      const SensorNoise& least, const SensorNoise& most) {
  double best = predictor.unlikelihood(model, noise);
  const auto improve = [&](double SensorNoise::*which, double factor) {
    bool any = false;
    for (const double by : {factor, 1.0 / factor}) {
      while (true) {
        SensorNoise there = noise;
        there.*which = std::clamp(there.*which * by, least.*which, most.*which);
        if (there.*which == noise.*which) break;
        const double value = predictor.unlikelihood(model, there);
        if (!(value < best)) break;
        best = value;
        noise = there;
        any = true;
      }
      if (any) break;
    }
    return any;
  };
  for (const double factor : {4.0, 2.0, 1.2}) {
    for (int pass = 0; pass < 3; ++pass) {
      const bool first = improve(&SensorNoise::voltage_v, factor);
      if (!improve(&SensorNoise::current_a, factor) && !first) break;
    }
  }
  predictor.filter(model, noise);
  return noise;
}

/// The torque that accelerates, rms, over spans of a hundredth of the window [N m].
double accelerating_torque(const Series& speeds, double period_s, double inertia) {
  const std::size_t span = std::max<std::size_t>(1, speeds.size() / 100);
  double sum = 0.0;
  std::size_t count = 0;
  for (std::size_t k = span; k < speeds.size(); k += span, ++count)
    sum += (speeds[k] - speeds[k - span]) * (speeds[k] - speeds[k - span]);
  return inertia * std::sqrt(sum / static_cast<double>(std::max<std::size_t>(1, count))) /
         (static_cast<double>(span) * period_s);
}

double rms(const Series& x) {
  double sum = 0.0;
  for (const double value : x)
    sum += value * value;
  return std::sqrt(sum / static_cast<double>(std::max<std::size_t>(1, x.size())));
}

/// Puts values and intervals at a fit into the result; the values of before become those of the equations.
void put_fit(const Settings& e, const std::vector<Unknown>& unknowns, const Fit& fit, Result& result) {
  for (Estimate& estimate : result.parameters)
    estimate.by_equations = estimate.value;
  const auto at = [&](const Eigen::VectorXd& z) {
    put(unknowns, z, result);
    put_dependent(e, result);
    std::vector<double> values;
    for (const Estimate& estimate : result.parameters)
      values.push_back(estimate.value);
    return values;
  };
  constexpr double kStep = 1e-6;
  std::vector<Eigen::VectorXd> gradients(result.parameters.size(), Eigen::VectorXd::Zero(fit.at.size()));
  const std::vector<double> values = at(fit.at);
  for (Eigen::Index k = 0; k < fit.at.size(); ++k) {
    Eigen::VectorXd there = fit.at;
    there(k) += kStep;
    const std::vector<double> moved = at(there);
    for (std::size_t n = 0; n < values.size(); ++n)
      gradients[n](k) = (moved[n] - values[n]) / kStep;
  }
  at(fit.at);
  for (std::size_t n = 0; n < values.size(); ++n)
    result.parameters[n].interval = k95 * std::sqrt(gradients[n].dot(fit.covariance * gradients[n]));
}

/// The parameters that these data do not determine. The electrical ones share the voltages: where one is
/// open, the valley of the error bends, and none of them is stated. `torque_nm` accelerates, `speed_rad_s` is
/// an rms.
std::vector<std::string> unseen_parameters(const Result& result, double torque_nm, double speed_rad_s) {
  std::vector<std::string> unseen;
  const auto immaterial = [&](const Estimate& e) {
    const double factor = e.name == "f" ? speed_rad_s : e.name == "f_c" || e.name == "tau_L" ? 1.0 : HUGE_VAL;
    return *e.interval * factor < kImmaterial * torque_nm;
  };
  for (const Estimate& e : result.parameters) {
    if (e.name == "K17" || e.name == "L_g") continue;
    const bool linear = e.name == "f" || e.name == "f_c" || e.name == "tau_L";
    const double widest = linear ? kWidestFriction : kWidest;
    if (!(*e.interval < widest * std::abs(e.value)) && !immaterial(e)) unseen.push_back(e.name);
  }
  const auto electrical = [](const Estimate& e) {
    constexpr std::array kMechanical = {"J", "f", "f_c", "tau_L", "K16", "K17"};
    return std::ranges::find(kMechanical, e.name) == kMechanical.end();
  };
  if (std::ranges::any_of(result.parameters, [&](const Estimate& e) {
        return electrical(e) && std::ranges::find(unseen, e.name) != unseen.end();
      })) {
    std::erase_if(unseen, [&](const std::string& name) { return electrical(*result.find(name)); });
    std::vector<std::string> all;
    for (const Estimate& e : result.parameters) {
      if (electrical(e)) all.push_back(e.name);
    }
    unseen.insert(unseen.begin(), all.begin(), all.end());
  }
  const auto is_unseen = [&](const char* name) { return std::ranges::find(unseen, name) != unseen.end(); };
  if (result.find("K17") != nullptr && (is_unseen("f") || is_unseen("tau_L") || is_unseen("J")))
    unseen.emplace_back("K17");
  return unseen;
}

/// A result with the refined values of `near`, where it has them.
Result begun(Result result, const Result& near) {
  const auto take = [&result](const Estimate& refined) {
    if (Estimate* const there = result.find(refined.name)) there->value = refined.value;
  };
  std::ranges::for_each(near.parameters, take);
  std::ranges::for_each(near.sensors, take);
  return result;
}

/// A motor at the fit with a bend of each power, which grows up to the flux that 95 % of the samples do not
/// exceed: the first samples of a run know the flux to within that of the largest current.
std::vector<BendingInductionModel> bending_motors(const Predictor<InductionModel>& predictor,
                                                  const BendingInductionModel& straight, double bend) {
  constexpr double kUsual = 0.95;
  Series flux_wb;
  for (const auto& x : predictor.filtered())
    flux_wb.push_back(std::abs(straight.magnetising_flux_wb({x[0], x[1], x[2], x[3], x[4]})));
  const auto usual =
      flux_wb.begin() + static_cast<std::ptrdiff_t>(kUsual * static_cast<double>(flux_wb.size()));
  std::nth_element(flux_wb.begin(), usual, flux_wb.end());
  std::vector<BendingInductionModel> motors(std::size(kBendPowers), straight);
  for (std::size_t k = 0; k < motors.size(); ++k) {
    motors[k].bend = bend;
    motors[k].power = kBendPowers[k];
    motors[k].reference_wb = *usual;
  }
  return motors;
}

/// What the fit says of iron that bends, or nothing if a motor with a bend leaves all bounds; `motor` is the
/// motor at the fit.
std::optional<BendTest> bend_of(const Predictor<InductionModel>& predictor, const Fit& fit,
                                const std::vector<Unknown>& unknowns, const BendingInductionModel& motor) {
  constexpr double kBend = 1e-4;
  const auto motors = bending_motors(predictor, motor, kBend);
  Eigen::MatrixXd directions(fit.residual.size(), static_cast<Eigen::Index>(motors.size()));
  if (!predictor.innovations(std::span<const BendingInductionModel>(motors), directions)) return {};
  directions.colwise() -= fit.residual;
  return test_bend(fit, unknowns, directions / kBend);
}

template <class Model>
void refine_with(const PredictorRecord& record, const Settings& e, Result& result, const Result* near) {
  const double duration_s = record.period_s * static_cast<double>(record.range.count());
  std::vector<Unknown> unknowns = unknowns_of(e, result, record.largest_speed, duration_s);
  add_sensors(e, record, result, unknowns);
  Result trial = near == nullptr ? result : begun(result, *near);
  Predictor<Model> predictor(record, Model(trial, e));
  const auto model_at = [&](const Eigen::VectorXd& z) {
    put(unknowns, z, trial);
    predictor.correct(errors_of(trial));
    return Model(trial, e);
  };
  const SensorNoise first = first_noise(record, e);
  const double voltage_rms_v = record.voltages.rms(record.range);
  const SensorNoise least{.voltage_v = 1e-4 * voltage_rms_v,
                          .current_a = kLeastCurrent * record.largest_current_a,
                          .angle_rad = first.angle_rad};
  const SensorNoise most{
      .voltage_v = voltage_rms_v, .current_a = record.largest_current_a, .angle_rad = first.angle_rad};
  const auto residuals = [&](const Eigen::MatrixXd& points, Eigen::MatrixXd& out) {
    out.resize(static_cast<Eigen::Index>(predictor.rows()), points.cols());
    std::vector<Model> models;  // those of the same sensors run side by side
    SensorErrors errors;
    Eigen::Index first_column = 0;
    const auto run = [&] {
      const auto count = static_cast<Eigen::Index>(models.size());
      predictor.correct(errors);
      const bool whole =
          predictor.innovations(std::span<const Model>(models), out.middleCols(first_column, count));
      models.clear();
      first_column += count;
      return whole;
    };
    for (Eigen::Index k = 0; k < points.cols(); ++k) {
      put(unknowns, points.col(k), trial);
      const Estimate* const sigma = trial.find("sigma");
      if (sigma != nullptr && sigma->value >= 1.0) return false;
      const SensorErrors here = errors_of(trial);
      if (!models.empty() && !(here == errors) && !run()) return false;
      errors = here;
      models.emplace_back(trial, e);
    }
    return run();
  };
  SensorNoise noise = first;
  noise.current_a = std::max(noise.current_a, kFirstCurrent * record.largest_current_a);
  if (near != nullptr) {
    noise.voltage_v = near->explanation->voltage_noise_v;
    noise.current_a = near->explanation->current_noise_a;
  }
  Fit fit;
  fit.at = coordinates_of(unknowns, trial);
  fit.found = true;
  for (int round = near == nullptr ? 0 : kRounds - 1; round < kRounds && fit.found; ++round) {
    predictor.linearise(model_at(fit.at), noise);
    if (round > 0 && near == nullptr) {
      noise.current_a = first.current_a;
      noise = likeliest(predictor, model_at(fit.at), noise, least, most);
    }
    fit = gauss_newton(residuals, fit.at, kLargestChange);
    if (round == 0 && fit.sum > kHopeless * static_cast<double>(predictor.rows())) fit.found = false;
  }
  if (!fit.found) {
    set_apart(e, result);
    result.excitation = verdict_against(result, "no motor near that of the equations follows it");
    return;
  }
  Series angle_errors;
  Series current_errors;
  for (Eigen::Index row = 0; row < fit.residual.size(); ++row)
    ((row + 1) % predictor.outputs() == 0 ? angle_errors : current_errors).push_back(fit.residual(row));
  put_fit(e, unknowns, fit, result);
  set_apart(e, result);
  result.explanation = {.voltage_noise_v = noise.voltage_v,
                        .voltage_rms_v = voltage_rms_v,
                        .current_noise_a = noise.current_a,
                        .current_error = rms(current_errors),
                        .current_white_a = first.current_a,
                        .angle_error = rms(angle_errors)};
  Series speeds;
  for (const auto& x : predictor.filtered())
    speeds.push_back(x[Model::kSpeed]);
  const Model motor = model_at(fit.at);
  std::optional<BendTest> bend;
  if constexpr (std::is_same_v<Model, InductionModel>)
    bend = bend_of(predictor, fit, unknowns, BendingInductionModel(trial, e));
  result.explanation->unlikelihood = predictor.unlikelihood(motor, noise);
  std::string reason = unexplained(*result.explanation, record.largest_current_a);
  for (const char* name : {"f", "f_c"}) {
    const Estimate* const friction = result.find(name);
    if (reason.empty() && friction != nullptr && friction->value + *friction->interval < 0.0)
      reason = std::string(name) + " comes out below zero, a friction that drives";
  }
  result.explanation->holds = reason.empty();
  if (!reason.empty()) {
    result.excitation = verdict_against(result, reason);
    return;
  }
  if (bend && bend->evidence > kTellsBend) {
    result.explanation->holds = false;
    result.excitation = verdict_on_saturation(result, *bend);
    return;
  }
  const double torque_nm = accelerating_torque(speeds, record.period_s, result.at("J"));
  result.excitation = verdict_on(e.kind, unseen_parameters(result, torque_nm, rms(speeds)));
  if (bend && result.excitation.sufficient) result.notes.push_back(straight_note(*bend));
}

/// Whether the estimates of the equations can begin a refinement: finite, and not zero where a motor is not.
bool can_begin(const Settings& e, const Result& result) {
  if (result.find("J") == nullptr) return false;
  for (const Unknown& unknown : unknowns_of(e, result, 1.0, 1.0)) {
    const double value = result.at(unknown.name);
    if (!std::isfinite(value) || (unknown.scale == 0.0 && value == 0.0)) return false;
  }
  return true;
}

/// Signs that a motor cannot have are turned, so that the search begins with a motor.
void make_positive(const Settings& e, Result& result) {
  for (const Unknown& unknown : unknowns_of(e, result, 1.0, 1.0)) {
    double& value = result.find(unknown.name)->value;
    if (unknown.scale == 0.0) value = std::abs(value);
  }
}

}  // namespace

void refine(const MeasuredData& data, const Settings& e, Result& result, const Result* near) {
  if (!can_begin(e, result)) {
    result.excitation = verdict_without_start(e.kind, result);
    return;
  }
  make_positive(e, result);
  const PredictorRecord record = record_of(data, e);
  if (const std::size_t all = window_of(data, e.processing).count(); all > e.most_samples)
    result.notes.push_back(
        fmt::format("refined from the first {} of {} samples of the window", e.most_samples, all));
  switch (e.kind) {
    case MotorKind::kDc:
      return refine_with<DcModel>(record, e, result, near);
    case MotorKind::kInduction:
      return refine_with<InductionModel>(record, e, result, near);
    case MotorKind::kPmSynchronous:
      return refine_with<PmModel>(record, e, result, near);
    case MotorKind::kBldc:
      return refine_with<BldcModel>(record, e, result, near);
  }
}

}  // namespace drivebench::identification
