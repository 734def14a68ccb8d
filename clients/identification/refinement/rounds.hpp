#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <vector>

#include "clients/identification/refinement/gauss_newton.hpp"
#include "clients/identification/refinement/predictor.hpp"
#include "clients/identification/refinement/saturation.hpp"
#include "clients/identification/refinement/sensor_unknowns.hpp"
#include "clients/identification/refinement/unknowns.hpp"

namespace drivebench::identification {

/// Rounds of linearisation, Gauss-Newton and noise; the last of them are fine.
struct Rounds {
  int first;
  int end;
  int fine;  ///< from this one on; after it a fit ends once the noises stand
};
inline constexpr Rounds kRounds = {.first = 0, .end = 2, .fine = 1};
inline constexpr Rounds kNearRounds = {.first = 1, .end = 2, .fine = 1};      ///< near a fit, with its noises
inline constexpr Rounds kLastCurveRound = {.first = 3, .end = 4, .fine = 3};  ///< of a magnetising curve
inline constexpr double kHopeless =
    25.0;  ///< mean square of the first round's innovations, where 1 is expected
inline constexpr double kNearStep = 0.03;      ///< in which derivatives stand
inline constexpr double kRoughly = 0.1;        ///< of a standard deviation: what a round leaves to the next
inline constexpr double kFinely = 0.01;        ///< what the last one leaves
inline constexpr double kLargestChange = 0.7;  ///< of a logarithm in a step
inline constexpr int kMostSteps = 15;          ///< of a round

/// The noises of voltages and currents that make the likelihood of so many samples greatest, each to a fifth.
template <class Model>
SensorNoise likeliest(Predictor<Model>& predictor, const Model& model, SensorNoise noise,
                      const SensorNoise& least, const SensorNoise& most, std::size_t samples) {
  Course best = predictor.course(model, noise, samples, {});
  std::vector<SensorNoise> tried{noise};  // none of them is better than `noise`
  const auto take_if_better = [&](const SensorNoise& there) {
    if (std::ranges::find(tried, there) != tried.end()) return false;
    tried.push_back(there);
    Course course = predictor.course(model, there, samples, best);
    if (!(course.end < best.end)) return false;
    best = std::move(course);
    noise = there;
    return true;
  };
  const auto improve = [&](double SensorNoise::*which, double factor) {
    bool any = false;
    for (const double by : {factor, 1.0 / factor}) {
      while (true) {
        SensorNoise there = noise;
        there.*which = std::clamp(there.*which * by, least.*which, most.*which);
        if (!take_if_better(there)) break;
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

/// The innovations of motors at coordinates. The last row of a motor with a magnetising curve is the split of
/// its leakages over its standard deviation, `split_weight` times: it lies between -1 and 1.
template <class Model>
class MotorResiduals {
 public:
  MotorResiduals(Predictor<Model>& predictor, const std::vector<Unknown>& unknowns, Result& trial,
                 const Settings& settings)
      : predictor_(predictor), unknowns_(unknowns), trial_(trial), settings_(settings) {
    const auto split = std::ranges::find(unknowns, "split", &Unknown::name);
    if (split != unknowns.end()) split_ = split - unknowns.begin();
  }

  bool values(const Eigen::VectorXd& at, Eigen::VectorXd& out) const {
    put(unknowns_, at, trial_);
    if (!is_motor(trial_)) return false;
    predictor_.correct(errors_of(trial_));
    if (!predictor_.innovations(Model(trial_, settings_), out, own_rows())) return false;
    if (split_ >= 0) out(out.size() - 1) = split_weight * at(split_);
    return true;
  }

  bool derivatives(const Eigen::VectorXd& at, Eigen::MatrixXd& out) const {
    put(unknowns_, at, trial_);
    if (!is_motor(trial_)) return false;
    const Model model(trial_, settings_);
    const SensorErrors errors = errors_of(trial_);
    predictor_.correct(errors);
    std::vector<Moved<Model>> moved;
    for (Eigen::Index k = 0; k < at.size(); ++k) {
      Eigen::VectorXd there = at;
      there(k) += kDifference;
      put(unknowns_, there, trial_);
      if (!is_motor(trial_)) return false;
      const SensorErrors seen = errors_of(trial_);
      moved.push_back(
          {.model = Model(trial_, settings_), .errors = seen, .sensors = !(seen == errors), .drives = true});
    }
    if (!predictor_.derivatives(model, moved, kDifference, out, own_rows())) return false;
    if (split_ >= 0) out(out.rows() - 1, split_) = split_weight;
    return true;
  }

  double split_weight = 1.0;

 private:
  static constexpr double kDifference = 1e-5;

  Eigen::Index own_rows() const noexcept { return split_ < 0 ? 0 : 1; }

  Predictor<Model>& predictor_;
  const std::vector<Unknown>& unknowns_;
  Result& trial_;
  const Settings& settings_;
  Eigen::Index split_ = -1;
};

/// Whether two noises are the same to within the fifth to which they are found.
inline bool stands(const SensorNoise& noise, const SensorNoise& before) {
  constexpr double kSame = 1.25;
  const auto same = [](double a, double b) { return a < kSame * b && b < kSame * a; };
  return same(noise.voltage_v, before.voltage_v) && same(noise.current_a, before.current_a);
}

/// The fit in rounds; `noise` begins the first round and becomes that of the last. A straight fit that begins
/// near has the noise that it is given; that of a curve is found again. A curve whose first round does not
/// end is none: what it takes over has no bottom.
template <class Model>
Fit fit_in_rounds(const PredictorRecord& record, const Settings& e, Predictor<Model>& predictor,
                  const std::vector<Unknown>& unknowns, Result& trial, SensorNoise& noise,
                  const Rounds& rounds) {
  constexpr double kHeldSplit = 30.0;  // until the curve has its shape
  const SensorNoise first = first_noise(record, e);
  const double voltage_rms_v = record.voltages.rms(record.range);
  const SensorNoise least{.voltage_v = 1e-4 * voltage_rms_v,
                          .current_a = kLeastCurrent * record.largest_current_a,
                          .angle_rad = first.angle_rad};
  const SensorNoise most{
      .voltage_v = voltage_rms_v, .current_a = record.largest_current_a, .angle_rad = first.angle_rad};
  MotorResiduals<Model> motors(predictor, unknowns, trial, e);
  const Residuals residuals{
      .values = [&](const Eigen::VectorXd& at, Eigen::VectorXd& out) { return motors.values(at, out); },
      .derivatives = [&](const Eigen::VectorXd& at,
                         Eigen::MatrixXd& out) { return motors.derivatives(at, out); }};
  const auto model_at = [&](const Eigen::VectorXd& z) {
    put(unknowns, z, trial);
    predictor.correct(errors_of(trial));
    return Model(trial, e);
  };
  const bool curved = is_saturated(trial);
  Fit fit;
  fit.at = coordinates_of(unknowns, trial);
  fit.found = true;
  for (int round = rounds.first; round < rounds.end && fit.found; ++round) {
    const SensorNoise before = noise;
    predictor.linearise(model_at(fit.at), noise);
    if (round > 0 && (rounds.first == 0 || curved)) {
      noise.current_a = first.current_a;
      noise = likeliest(predictor, model_at(fit.at), noise, least, most,
                        curved ? predictor.samples() : predictor.kUsualSamples);
    }
    motors.split_weight = round == 0 ? kHeldSplit : 1.0;
    const bool fine = round >= rounds.fine;
    fit = gauss_newton(residuals, fit.at,
                       {.limit = kLargestChange,
                        .near = kNearStep,
                        .small = fine ? kFinely : kRoughly,
                        .most = kMostSteps,
                        .valleys = curved,
                        .covariance = fine});
    if (round == 0 && fit.sum > kHopeless * static_cast<double>(predictor.rows())) fit.found = false;
    if (round == 0 && curved && !fit.ended) fit.found = false;
    if (fine && stands(noise, before)) break;
  }
  model_at(fit.at);
  return fit;
}

}  // namespace drivebench::identification
