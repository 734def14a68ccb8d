#include "clients/identification/refinement/refine.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numbers>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "clients/identification/data/magnetising_curve.hpp"
#include "clients/identification/motors/bending_induction.hpp"
#include "clients/identification/motors/saturated_induction.hpp"
#include "clients/identification/refinement/bend.hpp"
#include "clients/identification/refinement/gauss_newton.hpp"
#include "clients/identification/refinement/predictor.hpp"
#include "clients/identification/refinement/rounds.hpp"
#include "clients/identification/refinement/saturation.hpp"
#include "clients/identification/refinement/sensor_unknowns.hpp"
#include "clients/identification/refinement/suspects.hpp"
#include "clients/identification/refinement/unknowns.hpp"
#include "clients/identification/refinement/unseen.hpp"
#include "clients/identification/refinement/verdict.hpp"

namespace drivebench::identification {
namespace {

constexpr double k95 = 1.96;
constexpr double kFirstCurrent = 0.01;  ///< of the largest current: the noise that the first round allows

double rms(const Series& x) {
  double sum = 0.0;
  for (const double value : x)
    sum += value * value;
  return std::sqrt(sum / static_cast<double>(std::max<std::size_t>(1, x.size())));
}

/// Puts values and intervals at a fit into the result; the values of before become those of the equations.
void put_fit(const Settings& e, const std::vector<Unknown>& unknowns, const Fit& fit, Result& result) {
  for (Estimate& estimate : result.parameters) {
    if (!estimate.by_equations) estimate.by_equations = estimate.value;
  }
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

/// A result with the refined values of `near`, where it has them.
Result begun(Result result, const Result& near) {
  const auto take = [&result](const Estimate& refined) {
    if (Estimate* const there = result.find(refined.name)) there->value = refined.value;
  };
  std::ranges::for_each(near.parameters, take);
  std::ranges::for_each(near.sensors, take);
  return result;
}

/// The magnetising flux of a straight motor in each state of its predictor [Wb].
Series magnetising_fluxes(const Predictor<InductionModel>& predictor, const BendingInductionModel& straight) {
  Series flux_wb;
  for (const auto& x : predictor.filtered())
    flux_wb.push_back(std::abs(straight.magnetising_flux_wb({x[0], x[1], x[2], x[3], x[4]})));
  return flux_wb;
}

/// What the fit of an induction motor says of its iron.
struct Iron {
  std::optional<BendTest> bend{};  ///< of a straight motor; nothing if one with a bend leaves all bounds
  double largest_wb = 0.0;         ///< of the magnetising flux, once the filter knows it
};

constexpr std::ptrdiff_t kUnsettled = 16;  ///< a part of the record: until the filter knows the flux

/// The largest magnetising flux of a motor with a curve. One that begins at rest knows it from the start on,
/// whose flux is the largest.
double largest_flux_wb(const std::vector<Predictor<SaturatedInductionModel>::State>& filtered,
                       const PredictorRecord& record) {
  const auto unsettled = record.from_rest ? 0 : static_cast<std::ptrdiff_t>(filtered.size()) / kUnsettled;
  double largest2 = 0.0;
  for (auto x = filtered.begin() + unsettled; x != filtered.end(); ++x)
    largest2 = std::max(largest2, (*x)[2] * (*x)[2] + (*x)[3] * (*x)[3]);
  return std::sqrt(largest2);
}

Iron straight_of(const Predictor<InductionModel>& predictor, const Fit& fit,
                 const std::vector<Unknown>& unknowns, const BendingInductionModel& motor) {
  constexpr double kBend = 1e-4;
  const Series flux_wb = magnetising_fluxes(predictor, motor);
  const auto settled = flux_wb.begin() + static_cast<std::ptrdiff_t>(flux_wb.size()) / kUnsettled;
  Iron straight{.largest_wb = *std::max_element(settled, flux_wb.end())};
  const auto motors = bending_motors(flux_wb, motor, kBend);
  Eigen::MatrixXd directions(fit.residual.size(), static_cast<Eigen::Index>(motors.size()));
  Eigen::VectorXd bent;
  for (std::size_t k = 0; k < motors.size(); ++k) {
    if (!predictor.innovations(motors[k], bent)) return straight;
    directions.col(static_cast<Eigen::Index>(k)) = bent - fit.residual;
  }
  straight.bend = test_bend(fit, unknowns, directions / kBend);
  return straight;
}

/// What the innovations of a fit say of the noises.
template <class Model>
Explanation explanation_of(const Predictor<Model>& predictor, const Fit& fit, const SensorNoise& noise,
                           const PredictorRecord& record, const Settings& e) {
  Series angle_errors;
  Series current_errors;
  for (std::size_t row = 0; row < predictor.rows(); ++row)
    ((row + 1) % static_cast<std::size_t>(predictor.outputs()) == 0 ? angle_errors : current_errors)
        .push_back(fit.residual(static_cast<Eigen::Index>(row)));
  return {.voltage_noise_v = noise.voltage_v,
          .voltage_rms_v = record.voltages.rms(record.range),
          .current_noise_a = noise.current_a,
          .current_error = rms(current_errors),
          .current_white_a = first_noise(record, e).current_a,
          .angle_error = rms(angle_errors)};
}

/// What the innovations of a fit say of the errors of the sensors that it does not look for.
template <class Model>
std::optional<Suspicion> suspicion_of(const Predictor<Model>& predictor, const Fit& fit,
                                      const std::vector<Unknown>& unknowns, const Result& trial,
                                      const PredictorRecord& record, const Settings& e) {
  const Model model(trial, e);
  const std::vector<Suspect> suspects = suspects_of(e, record, errors_of(trial));
  std::vector<Moved<Model>> moved;
  for (const Suspect& suspect : suspects) {
    for (const SensorErrors& errors : suspect.errors)
      moved.push_back(
          {.model = model, .errors = errors, .sensors = true, .drives = !errors.drives_as(errors_of(trial))});
  }
  Eigen::MatrixXd directions;
  // No sensor moves the rows beyond those of the predictor.
  const Eigen::Index more_rows = fit.residual.size() - static_cast<Eigen::Index>(predictor.rows());
  if (!predictor.derivatives(model, moved, 1.0, directions, more_rows)) return {};
  return strongest_suspicion(fit, unknowns, suspects, std::move(directions));
}

/// Why this motor does not explain the record; empty if it does.
std::string reason_against(const Result& result, const PredictorRecord& record) {
  std::string reason = unexplained(*result.explanation, record.largest_current_a);
  for (const char* name : {"f", "f_c"}) {
    const Estimate* const friction = result.find(name);
    if (reason.empty() && friction != nullptr && friction->value + *friction->interval < 0.0)
      reason = std::string(name) + " comes out below zero, a friction that drives";
  }
  if (reason.empty() && is_saturated(result))
    reason = reason_against_curve(result, record.voltages.white_v(record.range));
  return reason;
}

/// Why a motor is not certified; nothing if it is.
struct Doubt {
  std::string reason{};  ///< that it does not explain the record
  std::optional<Suspicion> suspicion{};
  std::optional<BendTest> bend{};

  bool any() const { return !reason.empty() || suspicion || bend; }
};

/// Of a bend and an error of a sensor, which may look alike, the one that explains more is kept.
Doubt doubt_of(const Result& result, const PredictorRecord& record, const Iron& iron,
               const auto& ask_sensors) {
  std::string reason = reason_against(result, record);
  if (!reason.empty()) return {.reason = std::move(reason)};
  std::optional<Suspicion> suspicion = ask_sensors();
  const bool bends = iron.bend && iron.bend->evidence > kTellsBend;
  if (!bends) return {.suspicion = std::move(suspicion)};
  if (suspicion && suspicion->deviations * suspicion->deviations > iron.bend->evidence)
    return {.suspicion = std::move(suspicion)};
  return {.bend = iron.bend};
}

Excitation refusal(const Result& result, const Doubt& doubt) {
  if (doubt.suspicion) return verdict_on_suspicion(result, *doubt.suspicion);
  if (doubt.bend) return verdict_on_saturation(result, *doubt.bend);
  return verdict_against(result, doubt.reason);
}

/// A motor that was fitted to a record.
template <class Model>
struct Fitted {
  std::vector<Unknown> unknowns{};
  Result trial{};  ///< the values of the fit
  Predictor<Model> predictor;
  SensorNoise noise{};
  Fit fit{};
};

/// Where a fit begins: from a motor near by and its noises, or from those of the equations.
struct Begin {
  const Result* near = nullptr;
  std::optional<SensorNoise> noise{};
  Rounds rounds = kRounds;
};

Begin begin_near(const Result* near, const PredictorRecord& record, const Settings& e) {
  if (near == nullptr) return {};
  return {.near = near,
          .noise = SensorNoise{.voltage_v = near->explanation->voltage_noise_v,
                               .current_a = near->explanation->current_noise_a,
                               .angle_rad = first_noise(record, e).angle_rad},
          .rounds = kNearRounds};
}

/// Adds the errors of the sensors to `result` and fits it, with the predictor of another fit if there is one.
template <class Model>
Fitted<Model> fitted(const PredictorRecord& record, const Settings& e, Result& result, const Begin& begin,
                     std::optional<Predictor<Model>> predictor = {}) {
  const double duration_s = record.period_s * static_cast<double>(record.range.count());
  std::vector<Unknown> unknowns = unknowns_of(e, result, record.largest_speed, duration_s);
  add_sensors(e, record, result, unknowns);
  Result trial = begin.near == nullptr ? result : begun(result, *begin.near);
  SensorNoise noise = first_noise(record, e);
  noise.current_a = std::max(noise.current_a, kFirstCurrent * record.largest_current_a);
  if (!predictor) predictor.emplace(record, Model(trial, e));
  Fitted<Model> f{.unknowns = std::move(unknowns),
                  .trial = std::move(trial),
                  .predictor = *std::move(predictor),
                  .noise = begin.noise.value_or(noise)};
  f.fit = fit_in_rounds(record, e, f.predictor, f.unknowns, f.trial, f.noise, begin.rounds);
  return f;
}

void refuse_unfitted(const Settings& e, const std::vector<Unknown>& unknowns, Result& result) {
  set_apart(e, unknowns, false, result);
  result.excitation = verdict_against(result, "no motor near that of the equations follows it");
}

/// Estimates, noises and verdict of a fit.
template <class Model>
void judge(const PredictorRecord& record, const Settings& e, Fitted<Model>& f, const Iron& iron,
           Result& result) {
  put_fit(e, f.unknowns, f.fit, result);
  result.explanation = explanation_of(f.predictor, f.fit, f.noise, record, e);
  Series speeds;
  for (const auto& x : f.predictor.filtered())
    speeds.push_back(x[Model::kSpeed]);
  const Doubt doubt = doubt_of(
      result, record, iron, [&] { return suspicion_of(f.predictor, f.fit, f.unknowns, f.trial, record, e); });
  result.explanation->unlikelihood = f.predictor.unlikelihood(Model(f.trial, e), f.noise);
  result.explanation->holds = !doubt.any();
  set_apart(e, f.unknowns, result.explanation->holds, result);
  if (doubt.any()) {
    result.excitation = refusal(result, doubt);
    return;
  }
  const double torque_nm = accelerating_torque(speeds, record.period_s, result.at("J"));
  result.excitation = verdict_on(e.kind, unseen_parameters(result, torque_nm, rms(speeds)));
  if (iron.bend && result.excitation.sufficient) result.notes.push_back(straight_note(*iron.bend));
}

template <class Model>
void refine_with(const PredictorRecord& record, const Settings& e, Result& result, const Result* near) {
  Fitted<Model> f = fitted<Model>(record, e, result, begin_near(near, record, e));
  if (f.fit.found)
    judge(record, e, f, {}, result);
  else
    refuse_unfitted(e, f.unknowns, result);
}

/// The motor with a magnetising curve near a straight one that explains the record, if there is one. The
/// straight fit does not know the largest flux of the record, which the curve must reach: points that miss it
/// are placed anew after each round, if the iron is one there. All rounds but the last only lead to it, on
/// fewer samples.
std::optional<Result> saturated_near(const PredictorRecord& record, const Settings& e, const Result& straight,
                                     double largest_wb) {
  constexpr double kMiss = 0.02;
  const std::size_t by = rough_step(record);
  const PredictorRecord thin = thinned(record, by);
  Result result = saturated_start(straight, largest_wb);
  Result near;
  Begin begin;
  std::optional<Predictor<SaturatedInductionModel>> predictor;
  for (int round = 0; round < kLastCurveRound.first; ++round) {
    begin.rounds = {.first = round, .end = round + 1, .fine = kLastCurveRound.fine};
    auto rough =
        fitted<SaturatedInductionModel>(thin, e, result, begin, std::exchange(predictor, std::nullopt));
    if (!rough.fit.found) return {};
    rough.predictor.filter(SaturatedInductionModel(rough.trial, e), rough.noise);
    const double reached_wb = largest_flux_wb(rough.predictor.filtered(), thin);
    Result there = begun(saturated_start(straight, reached_wb, &rough.trial), rough.trial);
    if (std::abs(reached_wb / result.curve_wb.back() - 1.0) > kMiss && magnetising_curve(there).rises())
      result = std::move(there);
    near = std::move(rough.trial);
    predictor.emplace(std::move(rough.predictor));
    begin = {.near = &near, .noise = rough.noise};
  }
  begin.noise->voltage_v *= std::sqrt(static_cast<double>(by));  // periods that are held: a mean has less
  begin.rounds = kLastCurveRound;
  auto last = fitted<SaturatedInductionModel>(record, e, result, begin);
  if (!last.fit.found) return {};
  judge(record, e, last, {}, result);
  if (!result.explanation->holds) return {};
  return result;
}

/// An induction motor: straight if that explains the record, else with a magnetising curve if that does.
void refine_induction(const MeasuredData& data, const Settings& e, const PredictorRecord& record,
                      Result& result, const Result* near) {
  auto straight = fitted<InductionModel>(record, e, result, begin_near(near, record, e));
  if (!straight.fit.found) return refuse_unfitted(e, straight.unknowns, result);
  put_fit(e, straight.unknowns, straight.fit, result);
  const Iron iron = straight_of(straight.predictor, straight.fit, straight.unknowns,
                                BendingInductionModel(straight.trial, e));
  const bool bends = iron.bend && iron.bend->evidence > kTellsBend;
  const auto find_curve = [&] {
    return saturated_near(from_rest(record, data, e), e, result, iron.largest_wb);
  };
  std::optional<Result> saturated;
  if (bends) saturated = find_curve();
  if (!saturated || !saturated->excitation.sufficient) judge(record, e, straight, iron, result);
  if (!bends && !result.explanation->holds) saturated = find_curve();
  if (!saturated) return;
  if (saturated->excitation.sufficient) {
    std::ranges::move(unseen_split(*saturated), std::back_inserter(saturated->excitation.unseen));
    saturated->notes.push_back(curve_note(*saturated));
    result = *std::move(saturated);
  } else if (bends) {
    result.excitation = verdict_on_open_curve(*saturated);
  }
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
      refine_with<DcModel>(record, e, result, near);
      return;
    case MotorKind::kInduction:
      return refine_induction(data, e, record, result, near);
    case MotorKind::kPmSynchronous:
      refine_with<PmModel>(record, e, result, near);
      return;
    case MotorKind::kBldc:
      refine_with<BldcModel>(record, e, result, near);
      return;
  }
}

}  // namespace drivebench::identification
