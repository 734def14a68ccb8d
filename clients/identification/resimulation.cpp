#include "clients/identification/resimulation.hpp"

#include <fmt/core.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <string>

#include "clients/identification/math/runge_kutta.hpp"
#include "clients/identification/motors/induction/induction_regressor.hpp"
#include "clients/identification/motors/motor_models.hpp"
#include "clients/identification/motors/motors.hpp"
#include "clients/identification/motors/saturated_induction.hpp"
#include "clients/identification/motors/terminal_voltages.hpp"
#include "plant/math/phasor.hpp"

namespace drivebench::identification {
namespace {

constexpr double kStepOfRate = 0.2;
constexpr int kMostSteps = 1000;
constexpr double kBeyondAllBounds = 1e9;  // [A] or [rad/s]

/// The measured inputs of a model, and the measured signals to compare with.
struct Measured {
  TerminalVoltages voltages;
  std::vector<SeriesView> i;
  ShaftSignals shaft;
  double pole_pairs;

  Measured(const MeasuredData& data, const Settings& e)
      : voltages(data, e), shaft(shaft_signals(data, e, e.processing.current)), pole_pairs(e.pole_pairs) {
    for (std::size_t k = 0; k < voltages.phases(); ++k)
      i.push_back(data.at(fmt::format("i_{}_a", static_cast<char>('a' + k))));
  }

  MotorInput input(std::size_t sample, double part) const noexcept {
    const double electrical_rad = pole_pairs * value_at(shaft.angle, static_cast<double>(sample) + part);
    return {.u = voltages.at(sample, part),
            .electrical_rad = electrical_rad,
            .direction = phasor(electrical_rad)};
  }
  std::array<double, 3> currents(std::size_t sample) const noexcept {
    std::array<double, 3> values{};
    for (std::size_t k = 0; k < i.size(); ++k)
      values[k] = i[k][sample];
    return values;
  }
};

/// One step from `begin` on, in periods after the sample, as `length`.
template <class Model>
typename Model::State stepped(const Model& model, const Measured& m, const typename Model::State& x,
                              std::size_t sample, double begin, double length, double period_s) {
  auto y = runge_kutta(x, length * period_s, [&](const typename Model::State& at, double part) {
    return model.slope(at, m.input(sample, begin + part * length));
  });
  model.settle(y, x, length * period_s);
  return y;
}

/// The measured signals of the window, with space for the simulated ones.
Resimulation prepared(const Measured& m, const MeasuredData& data, const SampleRange& range) {
  Resimulation out;
  out.period_s = data.period_s;
  out.start_s = data.period_s * static_cast<double>(range.first);
  const auto add = [&](std::string name, std::string unit, SeriesView values) {
    const SeriesView window = values.subspan(range.first, range.count());
    out.signals.push_back({std::move(name), std::move(unit), {window.begin(), window.end()}, {}});
    out.signals.back().simulated.reserve(range.count());
  };
  for (std::size_t k = 0; k < m.i.size(); ++k)
    add(fmt::format("i_{}_a", static_cast<char>('a' + k)), "A", m.i[k]);
  add("speed_rad_s", "rad/s", m.shaft.speed);
  return out;
}

void rate(Resimulated& s) {
  double mean = 0.0;
  for (const double value : s.measured)
    mean += value;
  mean /= static_cast<double>(s.measured.size());
  double errors = 0.0;
  double variation = 0.0;
  for (std::size_t k = 0; k < s.measured.size(); ++k) {
    errors += (s.simulated[k] - s.measured[k]) * (s.simulated[k] - s.measured[k]);
    variation += (s.measured[k] - mean) * (s.measured[k] - mean);
  }
  s.rms_error = std::sqrt(errors / static_cast<double>(s.measured.size()));
  s.normalised = variation > 0.0 ? std::sqrt(errors / variation) : std::numeric_limits<double>::quiet_NaN();
}

template <class Model>
Resimulation run(const Model& model, typename Model::State x, const Measured& m, const MeasuredData& data,
                 const SampleRange& range, bool from_rest) {
  Resimulation out = prepared(m, data, range);
  out.from_rest = from_rest;
  const double rate_of_model = model.fastest_rate(largest(m.shaft.speed));
  const double steps = std::ceil(data.period_s * rate_of_model / kStepOfRate);
  if (!(steps <= kMostSteps))
    throw IdentificationError("no re-simulation: the motor found is too fast for the period of the data");
  const int substeps = std::max(1, static_cast<int>(steps));
  const double length = 1.0 / substeps;
  for (std::size_t k = from_rest ? 0 : range.first; k < range.end; ++k) {
    if (k >= range.first) {
      const std::array<double, 3> i = model.currents(x, m.input(k, 0.0));
      for (std::size_t phase = 0; phase < m.i.size(); ++phase)
        out.signals[phase].simulated.push_back(i[phase]);
      out.signals.back().simulated.push_back(x[Model::kSpeed]);
    }
    for (int n = 0; n < substeps; ++n)
      x = stepped(model, m, x, k, n * length, length, data.period_s);
    for (const double value : x) {
      if (!(std::abs(value) < kBeyondAllBounds))
        throw IdentificationError("no re-simulation: the motor found leaves all bounds on these voltages");
    }
  }
  for (Resimulated& signal : out.signals)
    rate(signal);
  return out;
}

template <class Model>
Resimulation run_from_measured(const Model& model, const Measured& m, const MeasuredData& data,
                               const SampleRange& range) {
  const bool rest = begins_at_rest(m.i, m.shaft.speed);
  const std::size_t start = rest ? 0 : range.first;
  auto x = model.state_of(m.currents(start), m.shaft.speed[start], m.input(start, 0.0));
  if (rest) x = {};
  return run(model, x, m, data, range, rest);
}

/// phi of an instant from the voltage equation, in the stator's frame: the book, (8.123).
std::complex<double> flux_of(const InductionModel& model, const InductionInstant& s, double electrical_rad) {
  const std::complex<double> i(s.i_x, s.i_y);
  const std::complex<double> slope(s.slope_x, s.slope_y);
  const std::complex<double> u(s.u_x, s.u_y);
  const double omega_e = model.pole_pairs * s.speed;
  const std::complex<double> phi =
      (model.transient_h * (slope + std::complex<double>(model.gamma, omega_e) * i) - u) /
      std::complex<double>(model.rotor_rate, -omega_e);
  return phi * phasor(electrical_rad);
}

Resimulation run_induction(const InductionModel& model, const Measured& m, const MeasuredData& data,
                           const Settings& e, const SampleRange& range) {
  if (begins_at_rest(m.i, m.shaft.speed)) return run(model, {}, m, data, range, true);
  const std::size_t start = range.first;
  const MotorInput in = m.input(start, 0.0);
  auto x = model.state_of(m.currents(start), m.shaft.speed[start], in);
  const std::complex<double> phi = flux_of(model, induction_instants(data, e)[start], in.electrical_rad);
  x[2] = phi.real();
  x[3] = phi.imag();
  return run(model, x, m, data, range, false);
}

/// The state with the flux that explains the currents of the first eighth of the window best: Gauss-Newton.
SaturatedInductionModel::State with_best_flux(const SaturatedInductionModel& model,
                                              SaturatedInductionModel::State x, const Measured& m,
                                              const MeasuredData& data, const SampleRange& range) {
  constexpr int kSteps = 6;
  const SampleRange part{range.first, range.first + std::max<std::size_t>(50, range.count() / 8)};
  const auto errors = [&](const SaturatedInductionModel::State& at) {
    const Resimulation tried = run(model, at, m, data, part, false);
    const auto samples = static_cast<Eigen::Index>(part.count());
    Eigen::VectorXd e(samples * static_cast<Eigen::Index>(m.i.size()));
    for (std::size_t phase = 0; phase < m.i.size(); ++phase) {
      const Resimulated& s = tried.signals[phase];
      for (std::size_t k = 0; k < part.count(); ++k)
        e(samples * static_cast<Eigen::Index>(phase) + static_cast<Eigen::Index>(k)) =
            s.simulated[k] - s.measured[k];
    }
    return e;
  };
  const double difference_wb = 1e-3 * model.curve.largest_wb();
  for (int step = 0; step < kSteps; ++step) {
    const Eigen::VectorXd here = errors(x);
    Eigen::MatrixXd slopes(here.size(), 2);
    for (int k = 0; k < 2; ++k) {
      SaturatedInductionModel::State moved = x;
      moved[2 + static_cast<std::size_t>(k)] += difference_wb;
      slopes.col(k) = (errors(moved) - here) / difference_wb;
    }
    const Eigen::Vector2d change = slopes.householderQr().solve(-here);
    x[2] += change(0);
    x[3] += change(1);
  }
  return x;
}

Resimulation run_saturated(const Result& result, const Measured& m, const MeasuredData& data,
                           const Settings& e, const SampleRange& range) {
  const SaturatedInductionModel model(result, e);
  if (begins_at_rest(m.i, m.shaft.speed)) return run(model, {}, m, data, range, true);
  const std::size_t start = range.first;
  const auto x = model.state_of(m.currents(start), m.shaft.speed[start], m.input(start, 0.0));
  return run(model, with_best_flux(model, x, m, data, range), m, data, range, false);
}

/// Throws if an estimate is not positive where a motor needs it.
void check(const Result& result) {
  if (!result.excitation.sufficient)
    throw IdentificationError("no re-simulation: " + result.excitation.verdict);
  for (const char* name :
       {"R", "L", "K_T", "R_S", "L_S", "L_d", "L_q", "T_R", "sigma", "K_m", "L+M", "tau_p", "J"}) {
    const Estimate* const e = result.find(name);
    if (e != nullptr && !(e->value > 0.0 && std::isfinite(e->value)))
      throw IdentificationError(
          fmt::format("no re-simulation: {} = {} is no value for a motor", name, e->value));
  }
}

}  // namespace

namespace {

/// The signals without the errors of the sensors that were found.
MeasuredData without_errors(MeasuredData data, const Result& result) {
  for (const bool gains : {false, true}) {  // a sensor shows gain times the truth, plus offset
    for (const Estimate& error : result.sensors) {
      const std::size_t blank = error.name.find(' ');
      if ((error.name.substr(blank + 1) == "gain") != gains) continue;
      for (Column& column : data.columns) {
        if (column.name != error.name.substr(0, blank)) continue;
        for (double& x : column.values)
          x = gains ? x / error.value : x - error.value;
      }
    }
  }
  return data;
}

}  // namespace

Resimulation resimulate(const MeasuredData& measured, const Settings& settings, const Result& result) {
  check(result);
  const MeasuredData data = without_errors(measured, result);
  Settings e = settings;
  for (const Estimate& error : result.sensors) {
    if (error.name == "angle offset") e.zero_rad += error.value / e.pole_pairs;
  }
  const SampleRange range = window_of(data, e.processing);
  const Measured m(data, e);
  switch (e.kind) {
    case MotorKind::kDc:
      return run_from_measured(DcModel(result, e), m, data, range);
    case MotorKind::kInduction:
      if (is_saturated(result)) return run_saturated(result, m, data, e, range);
      return run_induction(InductionModel(result, e), m, data, e, range);
    case MotorKind::kPmSynchronous:
      return run_from_measured(PmModel(result, e), m, data, range);
    case MotorKind::kBldc:
      break;
  }
  return run_from_measured(BldcModel(result, e), m, data, range);
}

}  // namespace drivebench::identification
