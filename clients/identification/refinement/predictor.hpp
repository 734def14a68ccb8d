#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <vector>

#include "clients/identification/math/runge_kutta.hpp"
#include "clients/identification/motors/motor_models.hpp"
#include "clients/identification/motors/terminal_voltages.hpp"

namespace drivebench::identification {

/// The errors of the sensors, white, rms.
struct SensorNoise {
  double voltage_v = 0.0;
  double current_a = 0.0;
  double angle_rad = 0.0;
};

/// What the sensors make of the truth: gain times it, plus offset, by phase.
struct SensorErrors {
  std::array<double, 3> current_gain = {1.0, 1.0, 1.0};
  std::array<double, 3> current_offset_a{};
  std::array<double, 3> voltage_gain = {1.0, 1.0, 1.0};
  std::array<double, 3> voltage_offset_v{};
  double angle_offset_rad = 0.0;  ///< electrical, added to that of the measured shaft
};

/// What the predictor needs of a record.
struct PredictorRecord {
  TerminalVoltages voltages;
  std::vector<SeriesView> currents;  ///< of each phase
  Series angle;                      ///< of the shaft as measured [rad]
  SampleRange range;                 ///< samples that are predicted
  double period_s;
  double pole_pairs;
  double first_speed;        ///< [rad/s]
  double largest_current_a;  ///< in the record
  double largest_speed;      ///< [rad/s]
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

  Predictor(const PredictorRecord& record, const Model& model) : r_(record) {
    const double steps = std::ceil(r_.period_s * model.fastest_rate(r_.largest_speed) / kStepOfRate);
    if (!(steps <= kMostSteps))
      throw IdentificationError("the motor found is too fast for the period of the data");
    substeps_ = std::max(1, static_cast<int>(steps));
    outputs_ = static_cast<int>(r_.currents.size()) + 1;
    samples_.resize(r_.range.count());
    const int places = 2 * substeps_ + 1;
    voltages_.reserve(samples_.size() * at(places));
    for (std::size_t k = r_.range.first; k < r_.range.end; ++k) {
      for (int place = 0; place < places; ++place)
        voltages_.push_back(r_.voltages.at(k, place / (2.0 * substeps_)));
    }
  }

  int outputs() const noexcept { return outputs_; }
  std::size_t rows() const noexcept { return samples_.size() * static_cast<std::size_t>(outputs_); }

  /// The errors that the measured signals are freed of from now on.
  void correct(const SensorErrors& errors) noexcept { errors_ = errors; }

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

  /// The innovations with the gains of the last filter(), over their expected rms, sample by sample; false if
  /// the run leaves all bounds.
  bool innovations(const Model& model, std::vector<double>& out) const {
    out.resize(rows());
    State x = first_state(model);
    std::size_t row = 0;
    for (std::size_t n = 0; n < samples_.size(); ++n) {
      const std::size_t k = r_.range.first + n;
      const Sample& s = samples_[n];
      for (int j = 0; j < outputs_; ++j) {
        const double e = measured(j, k) - output(model, x, j);
        out[row++] = e * s.weight[at(j)];
        for (int i = 0; i < kStates; ++i)
          x[at(i)] += s.gain(i, j) * e;
      }
      x = advanced(model, x, k, {});
      if (!bounded(x)) return false;
    }
    return true;
  }

  /// The speed of the last filter() or linearise() at each sample [rad/s].
  const Series& speeds() const noexcept { return speeds_; }

 private:
  static constexpr double kStepOfRate = 0.2;
  static constexpr double kMostSteps = 100.0;
  static constexpr double kBeyondAllBounds = 1e9;
  static constexpr double kDifference = 1e-3;  // of the derivatives by the state, in its largest values

  struct Sample {
    Square transition;  ///< of the state from this sample to the next
    Inputs drive;       ///< the next state by the voltages
    Outputs shown;      ///< the outputs by the state
    Eigen::Matrix<double, kStates, kMostOutputs> gain;
    std::array<double, std::size_t{kMostOutputs}> weight;
  };

  static constexpr std::size_t at(int index) noexcept { return static_cast<std::size_t>(index); }

  double measured(int output, std::size_t sample) const noexcept {
    return output + 1 == outputs_ ? r_.angle[sample] : current(at(output), sample);
  }

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

  double output(const Model& model, const State& x, int which) const noexcept {
    if (which + 1 == outputs_) return x.back();
    return model.currents(part_of(x), MotorInput{.u = {}, .electrical_rad = electrical(x.back())})[at(which)];
  }

  State advanced(const Model& model, State x, std::size_t sample,
                 const std::array<double, 3>& added_v) const {
    const std::array<double, 3>* const u = &voltages_[(sample - r_.range.first) * at(2 * substeps_ + 1)];
    for (int n = 0; n < substeps_; ++n) {
      const State before = x;
      x = runge_kutta(before, r_.period_s / substeps_, [&](const State& y, double part) {
        MotorInput in{.u = u[2 * n + static_cast<int>(2.0 * part)], .electrical_rad = electrical(y.back())};
        for (std::size_t k = 0; k < in.u.size(); ++k)
          in.u[k] = (in.u[k] - errors_.voltage_offset_v[k]) / errors_.voltage_gain[k] + added_v[k];
        const typename Model::State slope = model.slope(part_of(y), in);
        State all;
        std::copy(slope.begin(), slope.end(), all.begin());
        all.back() = y[Model::kSpeed];
        return all;
      });
      typename Model::State settled = part_of(x);
      model.settle(settled, part_of(before), r_.period_s / substeps_);
      std::copy(settled.begin(), settled.end(), x.begin());
    }
    return x;
  }

  State first_state(const Model& model) const {
    const std::size_t k = r_.range.first;
    State x{};
    x.back() = r_.angle[k];
    std::array<double, 3> currents{};
    for (std::size_t phase = 0; phase < r_.currents.size(); ++phase)
      currents[phase] = current(phase, k);
    const auto part =
        model.state_of(currents, r_.first_speed, {.u = {}, .electrical_rad = electrical(r_.angle[k])});
    std::copy(part.begin(), part.end(), x.begin());
    return x;
  }

  Square first_spread(const Model& model, const SensorNoise& noise) const {
    Square p = Square::Zero();
    const auto part = model.spread(kKnownPart * r_.largest_current_a, kKnownPart * r_.largest_speed);
    for (int i = 0; i + 1 < kStates; ++i)
      p(i, i) = part[at(i)] * part[at(i)];
    p(kStates - 1, kStates - 1) = 4.0 * noise.angle_rad * noise.angle_rad;
    return p;
  }

  static bool bounded(const State& x) noexcept {
    return std::ranges::all_of(x, [](double value) { return std::abs(value) < kBeyondAllBounds; });
  }

  void differentiate(const Model& model, const State& x, std::size_t k, Sample& s) const {
    const State next = advanced(model, x, k, {});
    const auto spread = model.spread(kDifference * r_.largest_current_a, kDifference * r_.largest_speed);
    for (int i = 0; i < kStates; ++i) {
      const double difference = i + 1 == kStates ? kDifference / r_.pole_pairs : spread[at(i)];
      State moved = x;
      moved[at(i)] += difference;
      const State there = advanced(model, moved, k, {});
      for (int row = 0; row < kStates; ++row)
        s.transition(row, i) = (there[at(row)] - next[at(row)]) / difference;
      for (int j = 0; j < outputs_; ++j)
        s.shown(j, i) = (output(model, moved, j) - output(model, x, j)) / difference;
    }
    s.drive.setZero();
    constexpr double kVolt = 1.0;
    for (std::size_t phase = 0; phase < r_.currents.size(); ++phase) {
      std::array<double, 3> added{};
      added[phase] = kVolt;
      const State there = advanced(model, x, k, added);
      for (int row = 0; row < kStates; ++row)
        s.drive(row, static_cast<int>(phase)) = (there[at(row)] - next[at(row)]) / kVolt;
    }
  }

  template <bool linearising>
  double run(const Model& model, const SensorNoise& noise,
             std::size_t most = std::numeric_limits<std::size_t>::max()) {
    State x = first_state(model);
    Square p = first_spread(model, noise);
    const double voltage2 = noise.voltage_v * noise.voltage_v;
    double sum = 0.0;
    speeds_.clear();
    for (std::size_t n = 0; n < std::min(most, samples_.size()); ++n) {
      const std::size_t k = r_.range.first + n;
      Sample& s = samples_[n];
      if constexpr (linearising) differentiate(model, x, k, s);
      for (int j = 0; j < outputs_; ++j) {
        const double sigma = j + 1 == outputs_ ? noise.angle_rad : noise.current_a;
        const Eigen::Matrix<double, kStates, 1> pc = p * s.shown.row(j).transpose();
        const double expected2 = s.shown.row(j).dot(pc) + sigma * sigma;
        const double e = measured(j, k) - output(model, x, j);
        s.gain.col(j) = pc / expected2;
        s.weight[at(j)] = 1.0 / std::sqrt(expected2);
        p.noalias() -= s.gain.col(j) * pc.transpose();
        for (int i = 0; i < kStates; ++i)
          x[at(i)] += s.gain(i, j) * e;
        sum += e * e / expected2 + std::log(expected2);
      }
      speeds_.push_back(x[Model::kSpeed]);
      x = advanced(model, x, k, {});
      if (!bounded(x)) return std::numeric_limits<double>::infinity();
      p = (s.transition * p * s.transition.transpose() + voltage2 * s.drive * s.drive.transpose()).eval();
      p = (0.5 * (p + p.transpose())).eval();
    }
    return std::isfinite(sum) ? sum : std::numeric_limits<double>::infinity();
  }

  const PredictorRecord& r_;
  SensorErrors errors_;
  int substeps_ = 1;
  int outputs_ = 0;
  std::vector<Sample> samples_;
  std::vector<std::array<double, 3>>
      voltages_;  ///< at both ends and in the middle of each step of each period
  Series speeds_;
};

}  // namespace drivebench::identification
