#include "clients/identification/motors/pm_motor.hpp"

#include <array>
#include <utility>

namespace drivebench::identification {
namespace {

/// All signals of the equations, filtered, in the frame of the magnet.
struct PmSignals {
  TwoPhaseSeries i;
  TwoPhaseSeries slope;
  TwoPhaseSeries u;
  Series speed;        ///< in the equations of the voltages, through the filter of the currents
  Series torque_a;     ///< i_q in the equation of motion, through the filter of the shaft
  ShaftSignals shaft;  ///< in the equation of motion
};

PmSignals dq_signals(const MeasuredData& data, const Settings& e) {
  const Processing& p = e.processing;
  PmSignals s;
  s.shaft = shaft_signals(data, e, p.shaft);
  ShaftSignals frame = shaft_signals(data, e, p.current);
  s.speed = std::move(frame.speed);
  Series electrical = std::move(frame.angle);
  for (double& angle : electrical)
    angle *= e.pole_pairs;
  const auto filtered = [&](const TwoPhaseSeries& x, const LowPass& filter) {
    const TwoPhaseSeries dq = rotated(x, electrical);
    return TwoPhaseSeries{zero_phase(dq.a, filter, data.period_s), zero_phase(dq.b, filter, data.period_s)};
  };
  TwoPhaseSeries u = windings(data, e, 'u', 'v');
  u = {.a = advanced(u.a, p.voltage_shift), .b = advanced(u.b, p.voltage_shift)};
  const TwoPhaseSeries i = windings(data, e, 'i', 'a');
  s.i = filtered(i, p.current);
  s.torque_a = zero_phase(rotated(i, electrical).b, p.shaft, data.period_s);
  s.u = filtered(u, p.voltage);
  s.slope = {.a = slope_of(s.i.a, data, p), .b = slope_of(s.i.b, data, p)};
  return s;
}

double sign_of(double x) {
  return x > 0.0 ? 1.0 : x < 0.0 ? -1.0 : 0.0;
}

constexpr std::array<const char*, 6> kNames = {"R_S", "L_S", "K_m", "J", "f", "f_c"};
constexpr std::array<const char*, 6> kUnits = {"ohm", "H", "N*m/A", "kg*m^2", "N*m*s/rad", "N*m"};

void take(Result& result, const LeastSquares& found, std::size_t first_name) {
  for (std::size_t n = 0; n < found.estimate.size(); ++n) {
    const std::size_t k = first_name + n;
    result.parameters.push_back({kNames[k], kUnits[k], found.estimate[n], found.index_double[n], {}});
  }
}

void check(Result& result, const PmSignals& s, const SampleRange& range) {
  if (!varies(s.shaft.speed, range)) add_unseen(result.excitation, {"J"}, "the speed does not change");
  expect_positive(result, {"R_S", "L_S", "K_m", "J"});
}

}  // namespace

Result identify_pm_motor(const MeasuredData& data, const Settings& e) {
  const SampleRange range = window_of(data, e.processing);
  const PmSignals s = dq_signals(data, e);
  Result result = {.kind = "pm_synchronous", .method = "PM synchronous motor, least squares in two stages"};
  result.samples = range.count();
  const auto electrical_rows = [&](Regression& fit, std::size_t columns) {
    std::array<double, 6> d{};
    std::array<double, 6> q{};
    for (std::size_t k = range.first; k < range.end; ++k) {
      const double omega_e = e.pole_pairs * s.speed[k];
      d = {s.i.a[k], s.slope.a[k] - omega_e * s.i.b[k], 0.0};
      q = {s.i.b[k], s.slope.b[k] + omega_e * s.i.a[k], s.speed[k]};
      fit.add(SeriesView(d).first(columns), s.u.a[k]);
      fit.add(SeriesView(q).first(columns), s.u.b[k]);
    }
  };
  if (!e.two_stage) {
    Regression fit({kNames.begin(), kNames.end()});
    electrical_rows(fit, 6);
    for (std::size_t k = range.first; k < range.end; ++k) {
      const double w = s.shaft.speed[k];
      fit.add(std::array{0.0, 0.0, -s.torque_a[k], s.shaft.acceleration[k], w, sign_of(w)}, 0.0);
    }
    const LeastSquares found = fit.solve();
    take(result, found, 0);
    result.method = "PM synchronous motor, least squares in one stage";
    result.error_index = found.error_index;
    result.condition = found.condition;
    result.excitation = found.excitation;
    check(result, s, range);
    return result;
  }
  Regression electrical({kNames.begin(), kNames.begin() + 3});
  electrical_rows(electrical, 3);
  const LeastSquares first = electrical.solve();
  Regression mechanical({kNames.begin() + 3, kNames.end()});
  for (std::size_t k = range.first; k < range.end; ++k) {
    const double w = s.shaft.speed[k];
    mechanical.add(std::array{s.shaft.acceleration[k], w, sign_of(w)}, first.estimate[2] * s.torque_a[k]);
  }
  const LeastSquares second = mechanical.solve();
  take(result, first, 0);
  take(result, second, 3);
  result.error_index = first.error_index;
  result.mechanical_error_index = second.error_index;
  result.condition = first.condition;
  result.excitation = joined(first.excitation, second.excitation);
  check(result, s, range);
  return result;
}

}  // namespace drivebench::identification
