#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <span>
#include <vector>

#include "clients/identification/refinement/gauss_newton.hpp"
#include "clients/identification/refinement/predictor.hpp"
#include "clients/identification/refinement/saturation.hpp"
#include "clients/identification/refinement/sensor_unknowns.hpp"
#include "clients/identification/refinement/unknowns.hpp"

namespace drivebench::identification {

inline constexpr int kRounds = 2;           ///< of linearisation, Gauss-Newton and noise
inline constexpr int kSaturatedRounds = 4;  ///< of a motor with a magnetising curve, until the noises stand
inline constexpr double kHopeless =
    25.0;  ///< mean square of the first round's innovations, where 1 is expected
inline constexpr double kNearStep = 0.03;      ///< in which the derivatives of a motor with a curve stand
inline constexpr double kLargestChange = 0.7;  ///< of a logarithm in a step

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

  bool operator()(const Eigen::MatrixXd& points, Eigen::MatrixXd& out) const {
    const auto rows = static_cast<Eigen::Index>(predictor_.rows());
    out.resize(rows + (split_ < 0 ? 0 : 1), points.cols());
    if (split_ >= 0) out.row(rows) = split_weight * points.row(split_);
    std::vector<Model> models;  // those of the same sensors run side by side
    SensorErrors errors;
    Eigen::Index first_column = 0;
    const auto run = [&] {
      const auto count = static_cast<Eigen::Index>(models.size());
      predictor_.correct(errors);
      const bool whole =
          predictor_.innovations(std::span<const Model>(models), out.block(0, first_column, rows, count));
      models.clear();
      first_column += count;
      return whole;
    };
    for (Eigen::Index k = 0; k < points.cols(); ++k) {
      put(unknowns_, points.col(k), trial_);
      if (!is_motor(trial_)) return false;
      const SensorErrors here = errors_of(trial_);
      if (!models.empty() && !(here == errors) && !run()) return false;
      errors = here;
      models.emplace_back(trial_, settings_);
    }
    return run();
  }

  double split_weight = 1.0;

 private:
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

/// The fit in rounds; `noise` begins the first round and becomes that of the last.
template <class Model>
Fit fit_in_rounds(const PredictorRecord& record, const Settings& e, Predictor<Model>& predictor,
                  const std::vector<Unknown>& unknowns, Result& trial, SensorNoise& noise, bool near) {
  constexpr double kHeldSplit = 30.0;  // until the curve has its shape
  const SensorNoise first = first_noise(record, e);
  const double voltage_rms_v = record.voltages.rms(record.range);
  const SensorNoise least{.voltage_v = 1e-4 * voltage_rms_v,
                          .current_a = kLeastCurrent * record.largest_current_a,
                          .angle_rad = first.angle_rad};
  const SensorNoise most{
      .voltage_v = voltage_rms_v, .current_a = record.largest_current_a, .angle_rad = first.angle_rad};
  MotorResiduals<Model> residuals(predictor, unknowns, trial, e);
  const auto model_at = [&](const Eigen::VectorXd& z) {
    put(unknowns, z, trial);
    predictor.correct(errors_of(trial));
    return Model(trial, e);
  };
  const int rounds = is_saturated(trial) ? kSaturatedRounds : kRounds;
  Fit fit;
  fit.at = coordinates_of(unknowns, trial);
  fit.found = true;
  for (int round = near ? rounds - 1 : 0; round < rounds && fit.found; ++round) {
    const SensorNoise before = noise;
    predictor.linearise(model_at(fit.at), noise);
    if (round > 0 && !near) {
      noise.current_a = first.current_a;
      noise = likeliest(predictor, model_at(fit.at), noise, least, most);
    }
    residuals.split_weight = round == 0 ? kHeldSplit : 1.0;
    fit = gauss_newton(residuals, fit.at, kLargestChange, is_saturated(trial) ? kNearStep : 0.0);
    if (round == 0 && fit.sum > kHopeless * static_cast<double>(predictor.rows())) fit.found = false;
    if (round > 1 && stands(noise, before)) break;
  }
  model_at(fit.at);
  return fit;
}

}  // namespace drivebench::identification
