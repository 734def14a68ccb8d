#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <tuple>
#include <vector>

#include "clients/identification/math/direction.hpp"
#include "clients/identification/math/runge_kutta.hpp"
#include "clients/identification/motors/motor_models.hpp"
#include "clients/identification/refinement/record.hpp"
#include "plant/math/phasor.hpp"

namespace drivebench::identification {

/// What the sensors make of the truth: gain times it, plus offset, by phase, all phases late alike; an
/// encoder that is late, and whose disc is off its centre.
struct SensorErrors {
  std::array<double, 3> current_gain = {1.0, 1.0, 1.0};
  std::array<double, 3> current_offset_a{};
  std::array<double, 3> voltage_gain = {1.0, 1.0, 1.0};
  std::array<double, 3> voltage_offset_v{};
  double angle_offset_rad = 0.0;  ///< electrical, added to that of the measured shaft
  double current_delay_s = 0.0;   ///< small: what was measured is moved on along its slope
  double voltage_delay_s = 0.0;   ///< likewise
  double angle_delay_s = 0.0;
  std::array<double, 2> eccentricity_rad{};  ///< by sine and cosine of the measured angle of the shaft

  bool operator==(const SensorErrors&) const = default;
  /// Whether a motor on the measured voltages runs alike under both.
  bool drives_as(const SensorErrors& other) const noexcept {
    return voltage_gain == other.voltage_gain && voltage_offset_v == other.voltage_offset_v &&
           voltage_delay_s == other.voltage_delay_s && angle_offset_rad == other.angle_offset_rad;
  }
};

/// A motor and its sensors after a move along one coordinate.
template <class Model>
struct Moved {
  Model model;
  SensorErrors errors;
  bool sensors;  ///< whether the errors have moved
  bool drives;   ///< whether the slopes have moved
};

/// A motor on the voltages of a record, from sample to sample, its own shaft turning its frame, and what a
/// step does to small changes of its state, of its parameters and of the sensors.
template <class Model>
class Flow {
 public:
  static constexpr int kStates = static_cast<int>(std::tuple_size_v<typename Model::State>) + 1;
  static constexpr int kMostOutputs = 4;  ///< currents of the phases, then the angle
  using State = std::array<double, std::tuple_size_v<typename Model::State> + 1>;
  using Vector = Eigen::Vector<double, kStates>;
  using Square = Eigen::Matrix<double, kStates, kStates>;
  using Outputs = Eigen::Matrix<double, kMostOutputs, kStates>;
  using Values = std::array<double, std::size_t{kMostOutputs}>;  ///< one for each output

  Flow(const PredictorRecord& record, const Model& model) : r_(record) {
    const double steps = std::ceil(r_.period_s * model.fastest_rate(r_.largest_speed) / kStepOfRate);
    if (!(steps <= kMostSteps))
      throw IdentificationError("the motor found is too fast for the period of the data");
    substeps_ = std::max(1, static_cast<int>(steps));
    outputs_ = static_cast<int>(r_.currents.size()) + 1;
    const auto spread = model.spread(kDifference * r_.largest_current_a, kDifference * r_.largest_speed);
    std::copy(spread.begin(), spread.end(), spread_.begin());
    spread_.back() = kDifference / r_.pole_pairs;
    correct({});
  }

  int outputs() const noexcept { return outputs_; }
  std::size_t samples() const noexcept { return r_.range.count(); }

  /// The errors of the sensors from now on. Gains, offsets and what turns with the encoder stand in the
  /// outputs, not in the measured signals: a gain of a measured current would move its noise with it and be
  /// taken for smaller than it is, by the noise over the current, squared.
  void correct(const SensorErrors& errors) {
    if (!measured_.empty() && errors == errors_) return;
    errors_ = errors;
    measured_.clear();
    voltages_.clear();
    measured_.reserve(samples() * at(outputs_));
    voltages_.reserve(samples() * at(2 * substeps_ + 1));
    for (std::size_t k = r_.range.first; k < r_.range.end; ++k) {
      for (std::size_t phase = 0; phase < r_.currents.size(); ++phase)
        measured_.push_back(current_at(phase, k, errors));
      measured_.push_back(r_.angle[k]);
      for (int place = 0; place <= 2 * substeps_; ++place) {
        std::array<double, 3> u = r_.voltages.at(k, place / (2.0 * substeps_));
        const std::array<double, 3> late = late_voltages(k, errors.voltage_delay_s);
        for (std::size_t phase = 0; phase < u.size(); ++phase)
          u[phase] = (u[phase] + late[phase] - errors.voltage_offset_v[phase]) / errors.voltage_gain[phase];
        voltages_.push_back(u);
      }
    }
  }

 protected:
  /// What a substep does to small changes, by the slopes in its middle.
  struct Tangent {
    Square transition{};  ///< of the state over the substep
    Square growth{};      ///< of its end by a slope that is added all along
    State middle{};
    Vector slope{};
    const std::array<double, 3>& u;
    Direction near;
  };

  static constexpr std::size_t at(int index) noexcept { return static_cast<std::size_t>(index); }

  static Vector vector_of(const State& x) noexcept { return Eigen::Map<const Vector>(x.data()); }

  double electrical(double shaft_rad, const SensorErrors& errors) const noexcept {
    return r_.pole_pairs * shaft_rad + errors.angle_offset_rad;
  }

  /// The current of a phase as measured, at the instant that it is said to be of.
  double current_at(std::size_t phase, std::size_t sample, const SensorErrors& errors) const noexcept {
    const SeriesView i = r_.currents[phase];
    if (errors.current_delay_s == 0.0) return i[sample];
    const SampleRange near = neighbours(sample);
    return i[sample] + errors.current_delay_s * (i[near.end] - i[near.first]) /
                           (r_.period_s * static_cast<double>(near.count()));
  }

  /// The samples beside one, which give a slope whose noise has nothing to do with that of the sample.
  SampleRange neighbours(std::size_t sample) const noexcept {
    return {std::max(sample, r_.range.first + 1) - 1, std::min(sample + 1, r_.range.end - 1)};
  }

  /// What the terminals have had since the voltages of a sample were measured so much too late.
  std::array<double, 3> late_voltages(std::size_t sample, double delay_s) const noexcept {
    std::array<double, 3> late{};
    if (delay_s == 0.0) return late;
    const SampleRange near = neighbours(sample);
    const std::array<double, 3> before = r_.voltages.at(near.first, 0.5);
    const std::array<double, 3> after = r_.voltages.at(near.end, 0.5);
    for (std::size_t phase = 0; phase < late.size(); ++phase)
      late[phase] =
          delay_s * (after[phase] - before[phase]) / (r_.period_s * static_cast<double>(near.count()));
    return late;
  }

  static typename Model::State part_of(const State& x) noexcept {
    typename Model::State part;
    std::copy_n(x.begin(), part.size(), part.begin());
    return part;
  }

  /// Of the rotor in this state, for a model that turns.
  Direction direction_at(const State& x) const noexcept {
    if constexpr (Model::kTurns) return Direction(electrical(x.back(), errors_));
    return {};
  }
  static std::complex<double> turned(const Direction& near, double electrical_rad) noexcept {
    if constexpr (Model::kTurns) return near.of(electrical_rad);
    return 1.0;
  }

  static double shown_angle(const State& x, const SensorErrors& errors) noexcept {
    double angle = x.back() - errors.angle_delay_s * x[Model::kSpeed];
    if (errors.eccentricity_rad != std::array<double, 2>{}) {
      const std::complex<double> turn = phasor(x.back());
      angle += errors.eccentricity_rad[0] * turn.imag() + errors.eccentricity_rad[1] * turn.real();
    }
    return angle;
  }

  Values outputs(const auto& model, const State& x, const Direction& near) const noexcept {
    return outputs(model, x, near, errors_);
  }
  Values outputs(const auto& model, const State& x, const Direction& near,
                 const SensorErrors& errors) const noexcept {
    const double electrical_rad = electrical(x.back(), errors);
    const auto i = model.currents(
        part_of(x), {.u = {}, .electrical_rad = electrical_rad, .direction = turned(near, electrical_rad)});
    Values values{};
    for (std::size_t phase = 0; phase < i.size(); ++phase)
      values[phase] = errors.current_gain[phase] * i[phase] + errors.current_offset_a[phase];
    values[at(outputs_ - 1)] = shown_angle(x, errors);
    return values;
  }

  /// The measured outputs of the n-th sample less these.
  Values errors_at(std::size_t n, const Values& values) const noexcept {
    Values e{};
    for (std::size_t j = 0; j < at(outputs_); ++j)
      e[j] = measured_[n * at(outputs_) + j] - values[j];
    return e;
  }

  /// The slope of the whole state.
  State slope(const auto& model, const State& x, const std::array<double, 3>& u, const Direction& near,
              const SensorErrors& errors) const noexcept {
    const double electrical_rad = electrical(x.back(), errors);
    const auto part = model.slope(
        part_of(x), {.u = u, .electrical_rad = electrical_rad, .direction = turned(near, electrical_rad)});
    State all;
    std::copy(part.begin(), part.end(), all.begin());
    all.back() = x[Model::kSpeed];
    return all;
  }

  /// The state after a substep of the n-th sample; u: at its begin, middle and end.
  State stepped(const auto& model, const State& before, const std::array<double, 3>* u,
                const Direction& near) const noexcept {
    const double step_s = r_.period_s / substeps_;
    State x = runge_kutta(before, step_s, [&](const State& y, double part) {
      return slope(model, y, u[static_cast<int>(2.0 * part)], near, errors_);
    });
    typename Model::State settled = part_of(x);
    model.settle(settled, part_of(before), step_s);
    std::copy(settled.begin(), settled.end(), x.begin());
    return x;
  }

  const std::array<double, 3>* voltages_at(std::size_t n) const noexcept {
    return &voltages_[n * at(2 * substeps_ + 1)];
  }

  Direction moved_on(const Direction& near, const State& x) const noexcept {
    if constexpr (Model::kTurns) return near.moved(electrical(x.back(), errors_));
    return near;
  }

  /// The state after the n-th sample, from x at it on.
  State advanced(const auto& model, State x, std::size_t n, Direction near) const noexcept {
    const std::array<double, 3>* u = voltages_at(n);
    for (int step = 0; step < substeps_; ++step, u += 2) {
      if (step > 0) near = moved_on(near, x);
      x = stepped(model, x, u, near);
    }
    return x;
  }

  /// The same, with what each substep does to small changes.
  State followed(const Model& model, State x, std::size_t n, Direction near, const auto& take) const {
    const double step_s = r_.period_s / substeps_;
    const std::array<double, 3>* u = voltages_at(n);
    for (int step = 0; step < substeps_; ++step, u += 2) {
      if (step > 0) near = moved_on(near, x);
      const State next = stepped(model, x, u, near);
      Tangent tangent{.u = u[1], .near = near};
      for (std::size_t k = 0; k < x.size(); ++k)
        tangent.middle[k] = 0.5 * (x[k] + next[k]);
      tangent.slope = vector_of(slope(model, tangent.middle, tangent.u, near, errors_));
      Square by_state;
      for (int i = 0; i < kStates; ++i) {
        State moved = tangent.middle;
        moved[at(i)] += spread_[at(i)];
        by_state.col(i) = (vector_of(slope(model, moved, tangent.u, near, errors_)) - tangent.slope) *
                          (step_s / spread_[at(i)]);
      }
      // e^X to the third order: a step is a fifth of the fastest time constant at most.
      Square inner = by_state / 3.0;
      inner.diagonal().array() += 1.0;
      tangent.transition.noalias() = 0.5 * by_state.lazyProduct(inner);
      tangent.transition.diagonal().array() += 1.0;
      inner = tangent.transition;
      tangent.transition.noalias() = by_state.lazyProduct(inner);
      tangent.transition.diagonal().array() += 1.0;
      tangent.growth = (0.5 * step_s) * tangent.transition;
      tangent.growth.diagonal().array() += 0.5 * step_s;
      take(tangent);
      x = next;
    }
    return x;
  }

  /// What the motor's slope in the middle of a substep becomes by a move, less what it was.
  Vector moved_slope(const Tangent& tangent, const Moved<Model>& m, std::size_t n) const noexcept {
    std::array<double, 3> u = tangent.u;
    if (m.sensors) {
      const std::array<double, 3> late =
          late_voltages(r_.range.first + n, m.errors.voltage_delay_s - errors_.voltage_delay_s);
      for (std::size_t phase = 0; phase < u.size(); ++phase)
        u[phase] = (u[phase] * errors_.voltage_gain[phase] + errors_.voltage_offset_v[phase] + late[phase] -
                    m.errors.voltage_offset_v[phase]) /
                   m.errors.voltage_gain[phase];
    }
    return vector_of(slope(m.model, tangent.middle, u, tangent.near, m.errors)) - tangent.slope;
  }

  /// How sensors that moved change the measured less the predicted outputs of the n-th sample.
  Eigen::Vector<double, kMostOutputs> sensed(const Moved<Model>& m, std::size_t n, const State& x,
                                             const Values& values) const noexcept {
    const Values there = outputs(m.model, x, direction_at(x), m.errors);
    Eigen::Vector<double, kMostOutputs> change = Eigen::Vector<double, kMostOutputs>::Zero();
    for (int j = 0; j < outputs_; ++j)
      change(j) = values[at(j)] - there[at(j)];
    for (std::size_t phase = 0; phase < r_.currents.size(); ++phase)
      change(static_cast<Eigen::Index>(phase)) +=
          current_at(phase, r_.range.first + n, m.errors) - measured_[n * at(outputs_) + phase];
    return change;
  }

  State first_state(const auto& model, const SensorErrors& errors) const {
    const std::size_t k = r_.range.first;
    State x{};
    x.back() = r_.angle[k];
    std::array<double, 3> currents{};
    for (std::size_t phase = 0; phase < r_.currents.size(); ++phase)
      currents[phase] =
          (current_at(phase, k, errors) - errors.current_offset_a[phase]) / errors.current_gain[phase];
    const double electrical_rad = electrical(r_.angle[k], errors);
    const auto part =
        model.state_of(currents, r_.first_speed,
                       {.u = {}, .electrical_rad = electrical_rad, .direction = phasor(electrical_rad)});
    std::copy(part.begin(), part.end(), x.begin());
    return x;
  }

  /// The outputs by the state.
  Outputs shown_at(const Model& model, const State& x, const Values& values,
                   const Direction& near) const noexcept {
    Outputs shown = Outputs::Zero();
    for (int i = 0; i < kStates; ++i) {
      State moved = x;
      moved[at(i)] += spread_[at(i)];
      const Values there = outputs(model, moved, near);
      for (int j = 0; j < outputs_; ++j)
        shown(j, i) = (there[at(j)] - values[at(j)]) / spread_[at(i)];
    }
    return shown;
  }

  const PredictorRecord& r_;
  SensorErrors errors_;
  int outputs_ = 0;

 private:
  static constexpr double kStepOfRate = 0.2;
  static constexpr double kMostSteps = 100.0;
  static constexpr double kDifference = 1e-3;  // of the derivatives by the state, in its largest values

  int substeps_ = 1;
  State spread_{};                               ///< of the differences by the state
  std::vector<double> measured_;                 ///< outputs of all samples, freed of the errors
  std::vector<std::array<double, 3>> voltages_;  ///< the same, at both ends and in the middle of each step
};

}  // namespace drivebench::identification
