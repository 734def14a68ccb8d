#include "clients/identification/motors/bldc_motor.hpp"

#include <array>
#include <numbers>
#include <string>

#include "clients/models/bldc_machine.hpp"

namespace drivebench::identification {
namespace {

/// The equations of three phases: one column for each parameter, all with the same filter.
struct BldcSignals {
  std::array<Series, 3> slope;
  std::array<Series, 3> i;
  std::array<Series, 3> emf;  ///< -w (e_k - e_mean)
  std::array<Series, 3> u;
  Series torque;       ///< e_1 i_1 + e_2 i_2 + e_3 i_3
  ShaftSignals shaft;  ///< in the equation of motion
};

BldcSignals phase_signals(const MeasuredData& data, const Settings& settings) {
  const Processing& p = settings.processing;
  const std::size_t n = data.samples();
  BldcSignals s;
  s.shaft = shaft_signals(data, settings, p.shaft);
  const ShaftSignals frame = shaft_signals(data, settings, p.current);
  s.torque.assign(n, 0.0);
  std::array<Series, 3> u;
  std::array<SeriesView, 3> i;
  for (std::size_t phase = 0; phase < 3; ++phase) {
    const std::string letter(1, static_cast<char>('a' + phase));
    i[phase] = data.at("i_" + letter + "_a");
    u[phase] = advanced(data.at("u_" + letter + "_v"), p.voltage_shift);
    s.emf[phase].resize(n);
  }
  for (std::size_t k = 0; k < n; ++k) {
    std::array<double, 3> e{};
    for (std::size_t phase = 0; phase < 3; ++phase)
      e[phase] = trapezoid_at_turns(
          (settings.pole_pairs * frame.angle[k] - static_cast<double>(phase) * 2.0 * std::numbers::pi / 3.0) /
          (2.0 * std::numbers::pi));
    const double mean_e = (e[0] + e[1] + e[2]) / 3.0;
    const double mean_u = (u[0][k] + u[1][k] + u[2][k]) / 3.0;
    for (std::size_t phase = 0; phase < 3; ++phase) {
      s.emf[phase][k] = -frame.speed[k] * (e[phase] - mean_e);
      u[phase][k] -= mean_u;
      s.torque[k] += e[phase] * i[phase][k];
    }
  }
  for (std::size_t phase = 0; phase < 3; ++phase) {
    s.i[phase] = zero_phase(i[phase], p.current, data.period_s);
    s.slope[phase] = slope_of(s.i[phase], data, p);
    s.emf[phase] = zero_phase(s.emf[phase], p.current, data.period_s);
    s.u[phase] = zero_phase(u[phase], p.voltage, data.period_s);
  }
  s.torque = zero_phase(s.torque, p.shaft, data.period_s);
  return s;
}

}  // namespace

Result identify_bldc_motor(const MeasuredData& data, const Settings& settings) {
  const SampleRange range = window_of(data, settings.processing);
  const BldcSignals s = phase_signals(data, settings);
  Regression electrical({"R_S", "L+M", "tau_p"});
  for (std::size_t k = range.first; k < range.end; ++k) {
    for (std::size_t phase = 0; phase < 3; ++phase)
      electrical.add(std::array{s.i[phase][k], s.slope[phase][k], s.emf[phase][k]}, s.u[phase][k]);
  }
  const LeastSquares first = electrical.solve();
  Regression mechanical({"J", "f"});
  for (std::size_t k = range.first; k < range.end; ++k)
    mechanical.add(std::array{s.shaft.acceleration[k], s.shaft.speed[k]}, -first.estimate[2] * s.torque[k]);
  const LeastSquares second = mechanical.solve();

  Result result = {.kind = "bldc", .method = "brushless DC motor, least squares in two stages"};
  const std::array<const char*, 5> units = {"ohm", "H", "N*m/A", "kg*m^2", "N*m*s/rad"};
  for (std::size_t n = 0; n < 3; ++n)
    result.parameters.push_back(
        {electrical.parameters()[n], units[n], first.estimate[n], first.index_double[n], {}});
  for (std::size_t n = 0; n < 2; ++n)
    result.parameters.push_back(
        {mechanical.parameters()[n], units[3 + n], second.estimate[n], second.index_double[n], {}});
  result.error_index = first.error_index;
  result.mechanical_error_index = second.error_index;
  result.condition = first.condition;
  result.samples = range.count();
  result.excitation = joined(first.excitation, second.excitation);
  if (!varies(s.shaft.speed, range)) add_unseen(result.excitation, {"J"}, "the speed does not change");
  expect_positive(result, {"R_S", "L+M", "tau_p", "J"});
  return result;
}

}  // namespace drivebench::identification
