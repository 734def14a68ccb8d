#include "clients/identification/motors/pm_motor.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

namespace drivebench::identification {
namespace {

/// All signals of the equations, filtered, in the frame of the magnet.
struct PmSignals {
  TwoPhaseSeries i;
  TwoPhaseSeries slope;
  TwoPhaseSeries u;
  Series speed;        ///< in the equations of the voltages, through the filter of the currents
  Series torque_a;     ///< i_q in the equation of motion, through the filter of the shaft
  Series torque_a2;    ///< n_p i_d i_q in it, formed before that filter
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
  TwoPhaseSeries measured = rotated(i, electrical);
  for (std::size_t k = 0; k < measured.a.size(); ++k)
    measured.a[k] *= e.pole_pairs * measured.b[k];
  s.torque_a = zero_phase(measured.b, p.shaft, data.period_s);
  s.torque_a2 = zero_phase(measured.a, p.shaft, data.period_s);
  s.u = filtered(u, p.voltage);
  s.slope = {.a = slope_of(s.i.a, data, p), .b = slope_of(s.i.b, data, p)};
  return s;
}

double sign_of(double x) {
  return x > 0.0 ? 1.0 : x < 0.0 ? -1.0 : 0.0;
}

struct PmName {
  const char* name;
  const char* unit;
};
using PmNames = std::vector<PmName>;

/// The parameters, the three mechanical ones last.
PmNames names_of(bool salient) {
  PmNames names = {{"R_S", "ohm"}, {"K_m", "N*m/A"}, {"J", "kg*m^2"}, {"f", "N*m*s/rad"}, {"f_c", "N*m"}};
  if (salient) {
    names.insert(names.begin() + 1, {{"L_d", "H"}, {"L_q", "H"}});
  } else {
    names.insert(names.begin() + 1, {"L_S", "H"});
  }
  return names;
}

std::vector<std::string> part_of(const PmNames& names, std::size_t first, std::size_t end) {
  std::vector<std::string> part;
  for (std::size_t k = first; k < end; ++k)
    part.emplace_back(names[k].name);
  return part;
}

void take(Result& result, const PmNames& names, const LeastSquares& found, std::size_t first) {
  for (std::size_t n = 0; n < found.estimate.size(); ++n) {
    const PmName& name = names[first + n];
    result.parameters.push_back({name.name, name.unit, found.estimate[n], found.index_double[n], {}});
  }
}

void check(Result& result, const PmNames& names, const PmSignals& s, const SampleRange& range) {
  if (!varies(s.shaft.speed, range)) add_unseen(result.excitation, {"J"}, "the speed does not change");
  expect_positive(result, part_of(names, 0, names.size() - 2));
}

/// The voltages of a sample: R_S, then L_S or L_d and L_q, then K_m; what stands behind them is zero.
void add_voltages(Regression& fit, const PmSignals& s, std::size_t k, double pole_pairs, bool salient,
                  std::size_t columns) {
  const double omega_e = pole_pairs * s.speed[k];
  std::array<double, 7> d = {s.i.a[k], s.slope.a[k]};
  std::array<double, 7> q = {s.i.b[k]};
  if (salient) {
    d[2] = -omega_e * s.i.b[k];
    q[1] = omega_e * s.i.a[k];
    q[2] = s.slope.b[k];
    q[3] = s.speed[k];
  } else {
    d[1] -= omega_e * s.i.b[k];
    q[1] = s.slope.b[k] + omega_e * s.i.a[k];
    q[2] = s.speed[k];
  }
  fit.add(SeriesView(d).first(columns), s.u.a[k]);
  fit.add(SeriesView(q).first(columns), s.u.b[k]);
}

/// All equations in one least squares: the torque is linear in L_d, L_q and K_m.
void solve_in_one_stage(Result& result, const PmNames& names, const PmSignals& s, const SampleRange& range,
                        double pole_pairs, bool salient) {
  Regression fit(part_of(names, 0, names.size()));
  for (std::size_t k = range.first; k < range.end; ++k)
    add_voltages(fit, s, k, pole_pairs, salient, names.size());
  for (std::size_t k = range.first; k < range.end; ++k) {
    const double w = s.shaft.speed[k];
    std::array<double, 7> row{};
    if (salient) {
      row[1] = -s.torque_a2[k];
      row[2] = s.torque_a2[k];
    }
    const std::array<double, 4> motion = {-s.torque_a[k], s.shaft.acceleration[k], w, sign_of(w)};
    std::copy(motion.begin(), motion.end(), row.begin() + static_cast<std::ptrdiff_t>(names.size() - 4));
    fit.add(SeriesView(row).first(names.size()), 0.0);
  }
  const LeastSquares found = fit.solve();
  take(result, names, found, 0);
  result.method += ", least squares in one stage";
  result.error_index = found.error_index;
  result.condition = found.condition;
  result.excitation = found.excitation;
}

void solve_in_two_stages(Result& result, const PmNames& names, const PmSignals& s, const SampleRange& range,
                         double pole_pairs, bool salient) {
  const std::size_t electrical = names.size() - 3;
  Regression voltages(part_of(names, 0, electrical));
  for (std::size_t k = range.first; k < range.end; ++k)
    add_voltages(voltages, s, k, pole_pairs, salient, electrical);
  const LeastSquares first = voltages.solve();
  const double saliency_h = salient ? first.estimate[1] - first.estimate[2] : 0.0;
  Regression motion(part_of(names, electrical, names.size()));
  for (std::size_t k = range.first; k < range.end; ++k) {
    const double w = s.shaft.speed[k];
    motion.add(std::array{s.shaft.acceleration[k], w, sign_of(w)},
               first.estimate.back() * s.torque_a[k] + saliency_h * s.torque_a2[k]);
  }
  const LeastSquares second = motion.solve();
  take(result, names, first, 0);
  take(result, names, second, electrical);
  result.method += ", least squares in two stages";
  result.error_index = first.error_index;
  result.mechanical_error_index = second.error_index;
  result.condition = first.condition;
  result.excitation = joined(first.excitation, second.excitation);
}

Result identify_pm(const MeasuredData& data, const Settings& e, bool salient) {
  const SampleRange range = window_of(data, e.processing);
  const PmSignals s = dq_signals(data, e);
  const PmNames names = names_of(salient);
  Result result = {.kind = "pm_synchronous",
                   .method = salient ? "salient PM synchronous motor" : "PM synchronous motor"};
  result.samples = range.count();
  if (e.two_stage) {
    solve_in_two_stages(result, names, s, range, e.pole_pairs, salient);
  } else {
    solve_in_one_stage(result, names, s, range, e.pole_pairs, salient);
  }
  check(result, names, s, range);
  return result;
}

}  // namespace

Result identify_pm_motor(const MeasuredData& data, const Settings& e) {
  return identify_pm(data, e, false);
}

Result identify_salient_pm_motor(const MeasuredData& data, const Settings& e) {
  Result result = identify_pm(data, e, true);
  Estimate saliency{.name = "L_g",
                    .unit = "H",
                    .value = 0.5 * (result.at("L_d") - result.at("L_q")),
                    .index = 0.5 * (result.find("L_d")->index + result.find("L_q")->index),
                    .truth = {}};
  result.parameters.insert(result.parameters.begin() + 3, std::move(saliency));
  return result;
}

}  // namespace drivebench::identification
