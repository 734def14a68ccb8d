#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <limits>
#include <numbers>
#include <span>
#include <vector>

#include "clients/identification/math/direction.hpp"
#include "clients/identification/math/runge_kutta.hpp"
#include "clients/identification/motors/motor_models.hpp"
#include "clients/identification/refinement/record.hpp"

namespace drivebench::identification {

/// What the sensors make of the truth: gain times it, plus offset, by phase.
struct SensorErrors {
  std::array<double, 3> current_gain = {1.0, 1.0, 1.0};
  std::array<double, 3> current_offset_a{};
  std::array<double, 3> voltage_gain = {1.0, 1.0, 1.0};
  std::array<double, 3> voltage_offset_v{};
  double angle_offset_rad = 0.0;  ///< electrical, added to that of the measured shaft

  bool operator==(const SensorErrors&) const = default;
};

/// A motor that is predicted from sample to sample: the model runs on the measured voltages, its own shaft
/// turns its frame, and after each sample a part of the difference between measured and predicted signals
/// (the innovation) goes into the state, the gains of an extended Kalman filter for the given noises. The
/// voltages' noise drives the state, those of currents and angle stand in the outputs. For the right motor
/// and the right noises the innovations are white, and their sum of squares is what maximum likelihood makes
/// least: output error where the voltages are exact, and it does not drift where they are not.
template <class Model>
class Predictor {
 public:
  static constexpr int kStates = static_cast<int>(std::tuple_size_v<typename Model::State>) + 1;
  static constexpr int kMostOutputs = 4;  ///< currents of the phases, then the angle
  using State = std::array<double, std::tuple_size_v<typename Model::State> + 1>;
  using Square = Eigen::Matrix<double, kStates, kStates>;
  using Inputs = Eigen::Matrix<double, kStates, 3>;
  using Outputs = Eigen::Matrix<double, kMostOutputs, kStates>;
  using Values = std::array<double, std::size_t{kMostOutputs}>;  ///< one for each output

  Predictor(const PredictorRecord& record, const Model& model) : r_(record) {
    const double steps = std::ceil(r_.period_s * model.fastest_rate(r_.largest_speed) / kStepOfRate);
    if (!(steps <= kMostSteps))
      throw IdentificationError("the motor found is too fast for the period of the data");
    substeps_ = std::max(1, static_cast<int>(steps));
    outputs_ = static_cast<int>(r_.currents.size()) + 1;
    samples_.resize(r_.range.count());
    corrections_.resize(samples_.size());
    correct({});
  }

  int outputs() const noexcept { return outputs_; }
  std::size_t rows() const noexcept { return samples_.size() * static_cast<std::size_t>(outputs_); }

  /// The errors that the measured signals are freed of from now on.
  void correct(const SensorErrors& errors) {
    if (!measured_.empty() && errors == errors_) return;
    errors_ = errors;
    measured_.clear();
    voltages_.clear();
    for (std::size_t k = r_.range.first; k < r_.range.end; ++k) {
      for (std::size_t phase = 0; phase < r_.currents.size(); ++phase)
        measured_.push_back(current(phase, k));
      measured_.push_back(r_.angle[k]);
      for (int place = 0; place <= 2 * substeps_; ++place) {
        std::array<double, 3> u = r_.voltages.at(k, place / (2.0 * substeps_));
        for (std::size_t phase = 0; phase < u.size(); ++phase)
          u[phase] = (u[phase] - errors.voltage_offset_v[phase]) / errors.voltage_gain[phase];
        voltages_.push_back(u);
      }
    }
  }

  /// Linearises the model along its filtered run with these noises.
  void linearise(const Model& model, const SensorNoise& noise) { run<true>(model, noise); }
  /// Works out the gains for these noises about the last linearisation.
  void filter(const Model& model, const SensorNoise& noise) { run<false>(model, noise); }
  /// Minus twice the logarithm of the likelihood of the first samples, less a constant; infinite if the run
  /// leaves all bounds. The gains are then those for these noises in these samples alone.
  double unlikelihood(const Model& model, const SensorNoise& noise) {
    constexpr std::size_t kSamples = 4000;  // tell two noises well enough
    return run<false>(model, noise, kSamples);
  }

  /// The innovations of each model with the gains of the last filter(), over their expected rms, sample by
  /// sample, a column for each model; false if a run leaves all bounds. The models run side by side, so that
  /// none waits for the end of its own step. They may be of another type with the same state.
  template <class Other>
  bool innovations(std::span<const Other> models, Eigen::Ref<Eigen::MatrixXd> out) const {
    std::vector<State> states;
    for (const Other& model : models)
      states.push_back(first_state(model));
    for (std::size_t n = 0; n < samples_.size(); ++n) {
      for (std::size_t m = 0; m < models.size(); ++m) {
        const auto row = static_cast<Eigen::Index>(n) * outputs_;
        states[m] = followed(models[m], states[m], n, &out(row, static_cast<Eigen::Index>(m)));
      }
      if (!std::ranges::all_of(states, bounded)) return false;
    }
    return true;
  }

  /// The state of the last filter() or linearise() at each sample, with the angle at its end.
  const std::vector<State>& filtered() const noexcept { return filtered_; }

 private:
  static constexpr double kStepOfRate = 0.2;
  static constexpr double kMostSteps = 100.0;
  static constexpr double kBeyondAllBounds = 1e9;
  static constexpr double kDifference = 1e-3;  // of the derivatives by the state, in its largest values

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

  static constexpr std::size_t at(int index) noexcept { return static_cast<std::size_t>(index); }

  double electrical(double shaft_rad) const noexcept {
    return r_.pole_pairs * shaft_rad + errors_.angle_offset_rad;
  }

  double current(std::size_t phase, std::size_t sample) const noexcept {
    return (r_.currents[phase][sample] - errors_.current_offset_a[phase]) / errors_.current_gain[phase];
  }

  static typename Model::State part_of(const State& x) noexcept {
    typename Model::State part;
    std::copy_n(x.begin(), part.size(), part.begin());
    return part;
  }

  /// Of the rotor in this state, for a model that turns.
  Direction direction_at(const State& x) const noexcept {
    if constexpr (Model::kTurns) return Direction(electrical(x.back()));
    return {};
  }
  static std::complex<double> turned(const Direction& near, double electrical_rad) noexcept {
    if constexpr (Model::kTurns) return near.of(electrical_rad);
    return 1.0;
  }

  Values outputs(const auto& model, const State& x, const Direction& near) const noexcept {
    const double electrical_rad = electrical(x.back());
    const auto i = model.currents(
        part_of(x), {.u = {}, .electrical_rad = electrical_rad, .direction = turned(near, electrical_rad)});
    Values values{};
    std::copy(i.begin(), i.end(), values.begin());
    values[at(outputs_ - 1)] = x.back();
    return values;
  }

  /// The measured outputs of the n-th sample less these.
  Values errors_at(std::size_t n, const Values& values) const noexcept {
    Values e{};
    for (std::size_t j = 0; j < at(outputs_); ++j)
      e[j] = measured_[n * at(outputs_) + j] - values[j];
    return e;
  }

  /// The state after the n-th sample, from x at it on, with voltages added to the measured ones.
  State advanced(const auto& model, State x, std::size_t n, const std::array<double, 3>& added_v,
                 Direction near) const {
    const std::array<double, 3>* u = &voltages_[n * at(2 * substeps_ + 1)];
    const double step_s = r_.period_s / substeps_;
    for (int step = 0; step < substeps_; ++step, u += 2) {
      const State before = x;
      if constexpr (Model::kTurns) {
        if (step > 0) near = near.moved(electrical(x.back()));
      }
      x = runge_kutta(before, step_s, [&](const State& y, double part) {
        const double electrical_rad = electrical(y.back());
        MotorInput in{.u = u[static_cast<int>(2.0 * part)],
                      .electrical_rad = electrical_rad,
                      .direction = turned(near, electrical_rad)};
        for (std::size_t k = 0; k < in.u.size(); ++k)
          in.u[k] += added_v[k];
        const typename Model::State slope = model.slope(part_of(y), in);
        State all;
        std::copy(slope.begin(), slope.end(), all.begin());
        all.back() = y[Model::kSpeed];
        return all;
      });
      typename Model::State settled = part_of(x);
      model.settle(settled, part_of(before), step_s);
      std::copy(settled.begin(), settled.end(), x.begin());
    }
    return x;
  }

  /// The state at the next sample; the innovations of the n-th one go to `out`.
  State followed(const auto& model, State x, std::size_t n, double* out) const {
    const Direction direction = direction_at(x);
    const Correction& c = corrections_[n];
    Values found = errors_at(n, outputs(model, x, direction));
    for (int j = 0; j < outputs_; ++j) {  // each after those before it have moved the state
      for (int i = 0; i < j; ++i)
        found[at(j)] -= c.coupling(j, i) * found[at(i)];
      out[j] = found[at(j)] * c.weight[at(j)];
      for (int i = 0; i < kStates; ++i)
        x[at(i)] += c.gain(i, j) * found[at(j)];
    }
    return advanced(model, x, n, {}, direction);
  }

  State first_state(const auto& model) const {
    const std::size_t k = r_.range.first;
    State x{};
    x.back() = r_.angle[k];
    std::array<double, 3> currents{};
    for (std::size_t phase = 0; phase < r_.currents.size(); ++phase)
      currents[phase] = current(phase, k);
    const double electrical_rad = electrical(r_.angle[k]);
    const auto part = model.state_of(
        currents, r_.first_speed,
        {.u = {}, .electrical_rad = electrical_rad, .direction = std::polar(1.0, electrical_rad)});
    std::copy(part.begin(), part.end(), x.begin());
    return x;
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

  void differentiate(const Model& model, const State& x, std::size_t n, const Direction& near,
                     Sample& s) const {
    const State next = advanced(model, x, n, {}, near);
    const Values values = outputs(model, x, near);
    const auto spread = model.spread(kDifference * r_.largest_current_a, kDifference * r_.largest_speed);
    for (int i = 0; i < kStates; ++i) {
      const double difference = i + 1 == kStates ? kDifference / r_.pole_pairs : spread[at(i)];
      State moved = x;
      moved[at(i)] += difference;
      const State there = advanced(model, moved, n, {}, near);
      const Values moved_values = outputs(model, moved, near);
      for (int row = 0; row < kStates; ++row)
        s.transition(row, i) = (there[at(row)] - next[at(row)]) / difference;
      for (int j = 0; j < outputs_; ++j)
        s.shown(j, i) = (moved_values[at(j)] - values[at(j)]) / difference;
    }
    s.drive.setZero();
    constexpr double kVolt = 1.0;
    for (std::size_t phase = 0; phase < r_.currents.size(); ++phase) {
      std::array<double, 3> added{};
      added[phase] = kVolt;
      const State there = advanced(model, x, n, added, near);
      for (int row = 0; row < kStates; ++row)
        s.drive(row, static_cast<int>(phase)) = (there[at(row)] - next[at(row)]) / kVolt;
    }
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
      sum += found[at(j)] * found[at(j)] / expected2 + std::log(expected2);
    }
    return sum;
  }

  template <bool linearising>
  double run(const Model& model, const SensorNoise& noise,
             std::size_t most = std::numeric_limits<std::size_t>::max()) {
    State x = first_state(model);
    Square p = first_spread(model, noise);
    const double voltage2 = noise.voltage_v * noise.voltage_v;
    double sum = 0.0;
    filtered_.clear();
    for (std::size_t n = 0; n < std::min(most, samples_.size()); ++n) {
      const Direction direction = direction_at(x);
      Sample& s = samples_[n];
      if constexpr (linearising) differentiate(model, x, n, direction, s);
      const Values errors = errors_at(n, outputs(model, x, direction));
      sum += corrected(s, noise, errors, x, p, corrections_[n]);
      filtered_.push_back(x);
      x = advanced(model, x, n, {}, direction);
      if (!bounded(x)) return std::numeric_limits<double>::infinity();
      const Square carried = s.transition * p;
      p.noalias() = carried * s.transition.transpose();
      p.noalias() += voltage2 * s.drive * s.drive.transpose();
      p = (0.5 * (p + p.transpose())).eval();
    }
    return std::isfinite(sum) ? sum : std::numeric_limits<double>::infinity();
  }

  const PredictorRecord& r_;
  SensorErrors errors_;
  int substeps_ = 1;
  int outputs_ = 0;
  std::vector<Sample> samples_;
  std::vector<Correction> corrections_;
  std::vector<double> measured_;                 ///< outputs of all samples, freed of the errors
  std::vector<std::array<double, 3>> voltages_;  ///< the same, at both ends and in the middle of each step
  std::vector<State> filtered_;
};

}  // namespace drivebench::identification
