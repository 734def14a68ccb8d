#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "clients/identification/refinement/flow.hpp"
#include "plant/math/trig.hpp"

namespace drivebench::identification {

/// Minus twice the logarithm of a likelihood, less a constant, as it grows with the samples.
struct Course {
  double end = std::numeric_limits<double>::infinity();  ///< of all samples
  std::vector<double> laps{};                            ///< after every so many samples
};

/// A motor that is predicted from sample to sample: the model runs on the measured voltages, its own shaft
/// turns its frame, and after each sample a part of the difference between measured and predicted signals
/// (the innovation) goes into the state, the gains of an extended Kalman filter for the given noises. The
/// voltages' noise drives the state, those of currents and angle stand in the outputs. For the right motor
/// and the right noises the innovations are white, and their sum of squares is what maximum likelihood makes
/// least: output error where the voltages are exact, and it does not drift where they are not.
template <class Model>
class Predictor : public Flow<Model> {
 public:
  using Base = Flow<Model>;
  using Base::kStates, Base::kMostOutputs, Base::outputs;
  using typename Base::Outputs, typename Base::Square, typename Base::State, typename Base::Values,
      typename Base::Vector;

  Predictor(const PredictorRecord& record, const Model& model)
      : Base(record, model),
        samples_(std::make_unique_for_overwrite<Sample[]>(Base::samples())),
        corrections_(std::make_unique_for_overwrite<Correction[]>(Base::samples())) {}

  static constexpr std::size_t kUsualSamples = 4000;  ///< tell two noises of most motors well enough

  std::size_t rows() const noexcept { return Base::samples() * at(outputs_); }

  /// Linearises the model along its filtered run with these noises.
  void linearise(const Model& model, const SensorNoise& noise) { run<true>(model, noise, kToTheEnd); }
  /// Works out the gains for these noises about the last linearisation.
  void filter(const Model& model, const SensorNoise& noise) { run<false>(model, noise, kToTheEnd); }
  /// Minus twice the logarithm of the likelihood of the first samples, less a constant; infinite if the run
  /// leaves all bounds. The gains are then those for these noises in these samples alone.
  double unlikelihood(const Model& model, const SensorNoise& noise) {
    return course(model, noise, kUsualSamples, {}).end;
  }
  /// The course of unlikelihood() over so many samples. If they are more than the usual ones and it falls
  /// behind that of a leader by 20 in the logarithm of the likelihood, it stops, and its end is infinite.
  Course course(const Model& model, const SensorNoise& noise, std::size_t samples, const Course& leader) {
    constexpr std::size_t kLap = 256;
    constexpr double kBehind = 40.0;
    Course own;
    own.end = run<false>(
        model, noise,
        [&](std::size_t n, double sum) {
          if (n % kLap != 0) return true;
          const std::size_t lap = own.laps.size();
          own.laps.push_back(sum);
          return samples <= kUsualSamples || lap >= leader.laps.size() || !(sum > leader.laps[lap] + kBehind);
        },
        samples);
    return own;
  }

  /// The innovations of a motor with the gains of the last filter(), over their expected rms, sample by
  /// sample, then so many rows for the caller; false if the run leaves all bounds. It may be of another type
  /// with the same state.
  bool innovations(const auto& model, Eigen::VectorXd& out, Eigen::Index more_rows = 0) const {
    State x = first_state(model, errors_);
    out.resize(static_cast<Eigen::Index>(rows()) + more_rows);
    out.tail(more_rows).setZero();
    for (std::size_t n = 0; n < Base::samples(); ++n) {
      const Direction direction = direction_at(x);
      const Values found = corrected_by_gains(n, errors_at(n, outputs(model, x, direction)), x);
      for (std::size_t j = 0; j < at(outputs_); ++j)
        out(static_cast<Eigen::Index>(n * at(outputs_) + j)) = found[j] * corrections_[n].weight[j];
      x = advanced(model, x, n, direction);
      if (!bounded(x)) return false;
    }
    return true;
  }

  /// The derivatives of innovations() by the coordinates that moved the motors by `difference`, a column for
  /// each, from the variational equations along the run of `model`; false if that leaves all bounds.
  bool derivatives(const Model& model, std::span<const Moved<Model>> moved, double difference,
                   Eigen::MatrixXd& out, Eigen::Index more_rows = 0) const {
    State x = first_state(model, errors_);
    const std::size_t count = moved.size();
    Columns shift(kStates, index(count));
    for (std::size_t k = 0; k < count; ++k)
      shift.col(index(k)) =
          (vector_of(first_state(moved[k].model, moved[k].errors)) - vector_of(x)) / difference;
    out.resize(static_cast<Eigen::Index>(rows()) + more_rows, shift.cols());
    out.bottomRows(more_rows).setZero();
    Eigen::Matrix<double, kMostOutputs, Eigen::Dynamic> errors(kMostOutputs, shift.cols());
    Columns slopes = Columns::Zero(kStates, shift.cols());
    Columns carried(kStates, shift.cols());
    for (std::size_t n = 0; n < Base::samples(); ++n) {
      const Direction direction = direction_at(x);
      const Values values = outputs(model, x, direction);
      errors.noalias() = -shown_at(model, x, values, direction).lazyProduct(shift);
      for (std::size_t k = 0; k < count; ++k) {
        if (moved[k].sensors) errors.col(index(k)) += sensed(moved[k], n, x, values) / difference;
      }
      correct_shifts(n, errors, shift, out);
      corrected_by_gains(n, errors_at(n, values), x);
      x = followed(model, x, n, direction, [&](const Tangent& tangent) {
        for (std::size_t k = 0; k < count; ++k) {
          if (moved[k].drives) slopes.col(index(k)) = moved_slope(tangent, moved[k], n) / difference;
        }
        carried.noalias() = tangent.transition.lazyProduct(shift);
        carried.noalias() += tangent.growth.lazyProduct(slopes);
        shift.swap(carried);
      });
      if (!bounded(x)) return false;
    }
    return out.allFinite();
  }

  /// The state of the last filter() or linearise() at each sample, with the angle at its end.
  const std::vector<State>& filtered() const noexcept { return filtered_; }

 private:
  using Inputs = Eigen::Matrix<double, kStates, 3>;
  using Columns = Eigen::Matrix<double, kStates, Eigen::Dynamic>;  ///< of a state by each coordinate
  using Base::advanced, Base::at, Base::direction_at, Base::errors_at, Base::first_state, Base::followed;
  using Base::errors_, Base::moved_slope, Base::outputs_, Base::r_, Base::sensed, Base::shown_at, Base::slope,
      Base::vector_of;
  using typename Base::Tangent;

  static constexpr double kBeyondAllBounds = 1e9;
  static constexpr double kVolt = 1.0;  // of the derivatives by the voltages

  struct Sample {
    Square transition;  ///< of the state from this sample to the next
    Inputs drive;       ///< the next state by the voltages
    Outputs shown;      ///< the outputs by the state
  };
  /// What the innovations of a sample do.
  struct Correction {
    Eigen::Matrix<double, kStates, kMostOutputs> gain;
    Eigen::Matrix<double, kMostOutputs, kMostOutputs> coupling;  ///< output `row` moves with that of `column`
    Values weight;
  };

  static Eigen::Index index(std::size_t k) noexcept { return static_cast<Eigen::Index>(k); }

  /// The innovations of the n-th sample, each after those before it have moved the state, from the errors of
  /// the outputs; they move x.
  Values corrected_by_gains(std::size_t n, Values found, State& x) const noexcept {
    const Correction& c = corrections_[n];
    for (int j = 0; j < outputs_; ++j) {
      for (int i = 0; i < j; ++i)
        found[at(j)] -= c.coupling(j, i) * found[at(i)];
      for (int i = 0; i < kStates; ++i)
        x[at(i)] += c.gain(i, j) * found[at(j)];
    }
    return found;
  }

  /// The same of small changes; their rows of the derivatives go to `out`.
  void correct_shifts(std::size_t n, auto& errors, Columns& shift, Eigen::MatrixXd& out) const {
    const Correction& c = corrections_[n];
    for (int j = 0; j < outputs_; ++j) {
      for (int i = 0; i < j; ++i)
        errors.row(j) -= c.coupling(j, i) * errors.row(i);
      shift.noalias() += c.gain.col(j).lazyProduct(errors.row(j));
    }
    for (Eigen::Index k = 0; k < shift.cols(); ++k) {
      for (int j = 0; j < outputs_; ++j)
        out(index(n) * outputs_ + j, k) = c.weight[at(j)] * errors(j, k);
    }
  }

  Square first_spread(const Model& model, const SensorNoise& noise) const {
    Square p = Square::Zero();
    const auto part = model.spread(kKnownPart * r_.largest_current_a, kKnownPart * r_.largest_speed);
    constexpr double kRest = 0.02;
    for (int i = 0; i + 1 < kStates; ++i)
      p(i, i) = part[at(i)] * part[at(i)] * (r_.from_rest ? kRest * kRest : 1.0);
    p(kStates - 1, kStates - 1) = 4.0 * noise.angle_rad * noise.angle_rad;
    return p;
  }

  static bool bounded(const State& x) noexcept {
    return std::ranges::all_of(x, [](double value) { return std::abs(value) < kBeyondAllBounds; });
  }

  /// The state after the n-th sample, with its derivatives.
  State differentiated(const Model& model, const State& x, std::size_t n, const Direction& near,
                       Sample& s) const {
    s.transition.setIdentity();
    s.drive.setZero();
    return followed(model, x, n, near, [&](const Tangent& tangent) {
      Inputs by_voltage = Inputs::Zero();
      for (std::size_t phase = 0; phase < r_.currents.size(); ++phase) {
        std::array<double, 3> u = tangent.u;
        u[phase] += kVolt;
        by_voltage.col(static_cast<Eigen::Index>(phase)) =
            (vector_of(slope(model, tangent.middle, u, tangent.near, errors_)) - tangent.slope) / kVolt;
      }
      s.drive = (tangent.transition * s.drive + tangent.growth * by_voltage).eval();
      s.transition = (tangent.transition * s.transition).eval();
    });
  }

  /// Gains, coupling and weights of a sample, one output after the other; p becomes the spread after them.
  /// The sum of squared innovations over their variance, with its logarithm.
  double corrected(const Sample& s, const SensorNoise& noise, const Values& errors, State& x, Square& p,
                   Correction& c) const {
    double sum = 0.0;
    Values found{};
    for (int j = 0; j < outputs_; ++j) {
      const double sigma = j + 1 == outputs_ ? noise.angle_rad : noise.current_a;
      const Eigen::Matrix<double, kStates, 1> pc = p * s.shown.row(j).transpose();
      const double expected2 = s.shown.row(j).dot(pc) + sigma * sigma;
      c.gain.col(j) = pc / expected2;
      c.weight[at(j)] = 1.0 / std::sqrt(expected2);
      p.noalias() -= c.gain.col(j) * pc.transpose();
      found[at(j)] = errors[at(j)];
      for (int i = 0; i < j; ++i) {
        c.coupling(j, i) = s.shown.row(j).dot(c.gain.col(i));
        found[at(j)] -= c.coupling(j, i) * found[at(i)];
      }
      for (int i = 0; i < kStates; ++i)
        x[at(i)] += c.gain(i, j) * found[at(j)];
      sum += found[at(j)] * found[at(j)] / expected2 + logarithm(expected2);
    }
    return sum;
  }

  /// While the encoder shows its first count the error of that is one error: all these samples tell as much
  /// of the angle as one does, and of the speed that the shaft has not moved by a count.
  SensorNoise noise_at(std::size_t n, SensorNoise noise) const noexcept {
    if (n < r_.still) noise.angle_rad *= std::sqrt(static_cast<double>(r_.still));
    return noise;
  }

  static constexpr auto kToTheEnd = [](std::size_t, double) { return true; };

  /// `goes_on` is asked at each sample, with the sum before it; a run that does not ends with infinity.
  template <bool linearising>
  double run(const Model& model, const SensorNoise& noise, const auto& goes_on,
             std::size_t most = std::numeric_limits<std::size_t>::max()) {
    State x = first_state(model, errors_);
    Square p = first_spread(model, noise);
    const double voltage2 = noise.voltage_v * noise.voltage_v;
    double sum = 0.0;
    filtered_.clear();
    filtered_.reserve(Base::samples());
    for (std::size_t n = 0; n < std::min(most, Base::samples()); ++n) {
      if (!goes_on(n, sum)) return std::numeric_limits<double>::infinity();
      const Direction direction = direction_at(x);
      Sample& s = samples_[n];
      const Values values = outputs(model, x, direction);
      if constexpr (linearising) s.shown = shown_at(model, x, values, direction);
      const Values errors = errors_at(n, values);
      sum += corrected(s, noise_at(n, noise), errors, x, p, corrections_[n]);
      filtered_.push_back(x);
      if constexpr (linearising)
        x = differentiated(model, x, n, direction, s);
      else
        x = advanced(model, x, n, direction);
      if (!bounded(x)) return std::numeric_limits<double>::infinity();
      const Square carried = s.transition * p;
      p.noalias() = carried * s.transition.transpose();
      p.noalias() += voltage2 * s.drive * s.drive.transpose();
      p = (0.5 * (p + p.transpose())).eval();
    }
    return std::isfinite(sum) ? sum : std::numeric_limits<double>::infinity();
  }

  std::unique_ptr<Sample[]> samples_;  ///< filled by linearise(), as many as there are samples
  std::unique_ptr<Correction[]> corrections_;
  std::vector<State> filtered_;
};

}  // namespace drivebench::identification
