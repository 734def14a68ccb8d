#include "clients/identification/motors/induction/resistance_tracking.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "clients/identification/data/noise.hpp"
#include "clients/identification/data/signals.hpp"
#include "clients/identification/math/filters.hpp"
#include "clients/identification/math/real_roots.hpp"

namespace drivebench::identification {
namespace {

/// Below this part of what the column of 1/T_R would be with the rotor open, its current is too small to see.
constexpr double kLeastRotorShare = 0.02;
/// Of the parameter, half of the 95 % interval: above it nothing is stated.
constexpr double kWidestShare = 0.1;
/// Parts of the data whose scores are independent: longer than the memory of the filters.
constexpr std::size_t kScoreParts = 10;
/// Of the speed over the data: the equations count it as constant.
constexpr double kMostSpeedChange = 5e-3;

/// The sums of the regression, whole (exact) or as doubles; index 3 is y.
template <class Number>
using Sums = std::array<std::array<Number, 4>, 4>;

template <class Number, class Entries>
Sums<Number> sums_of(const Entries& entry) {
  Sums<Number> s{};
  for (std::size_t a = 0; a < 4; ++a) {
    for (std::size_t b = 0; b < 4; ++b) {
      s[a][b] = Number(0);
      for (std::size_t i = 0; i < 4; ++i)
        s[a][b] += entry(i, a) * entry(i, b);
    }
  }
  return s;
}

/// dE^2/dK_1 = 2 (a_1 K_1 + a_0) and dE^2/dK_2 = 2 (b_2 K_1^2 + b_1 K_1 + b_0), as polynomials in K_2.
template <class Number>
struct Conditions {
  Polynomial<Number> a0, a1, b0, b1, b2;
  explicit Conditions(const Sums<Number>& s)
      : a0(std::vector<Number>{-s[0][3], s[0][1] - s[2][3], s[1][2]}),
        a1(std::vector<Number>{s[0][0], 2 * s[0][2], s[2][2]}),
        b0(std::vector<Number>{-s[1][3], s[1][1]}),
        b1(std::vector<Number>{s[0][1] - s[2][3], 2 * s[1][2]}),
        b2(std::vector<Number>{s[0][2], s[2][2]}) {}
};

struct Point {
  double k1, k2, residual;
};

double residual_at(const Triangle& r, double k1, double k2) {
  double sum = 0.0;
  for (std::size_t i = 0; i < 4; ++i) {
    const double error = r(i, 0) * k1 + r(i, 1) * k2 + r(i, 2) * k1 * k2 - r(i, 3);
    sum += error * error;
  }
  return sum;
}

/// Of E^2 by K_1 and K_2.
std::vector<std::vector<double>> hessian_at(const Sums<double>& s, const Point& p) {
  const double first = s[0][0] + p.k2 * (2.0 * s[0][2] + p.k2 * s[2][2]);
  const double second = s[1][1] + p.k1 * (2.0 * s[1][2] + p.k1 * s[2][2]);
  const double mixed =
      s[0][1] - s[2][3] + 2.0 * (p.k1 * s[0][2] + p.k2 * s[1][2]) + 2.0 * p.k1 * p.k2 * s[2][2];
  return {{2.0 * first, 2.0 * mixed}, {2.0 * mixed, 2.0 * second}};
}

/// The pulsation of the currents in the rotor's frame over that of the stator.
double slip_of(std::span<const InductionInstant> instants, double pole_pairs) {
  double turned = 0.0;
  double squares = 0.0;
  double electrical_rad_s = 0.0;
  for (const InductionInstant& q : instants) {
    turned += q.i_x * q.slope_y - q.i_y * q.slope_x;
    squares += q.i_x * q.i_x + q.i_y * q.i_y;
    electrical_rad_s += pole_pairs * q.speed / static_cast<double>(instants.size());
  }
  if (squares == 0.0) return 0.0;
  const double slip_rad_s = turned / squares;
  return slip_rad_s / (electrical_rad_s + slip_rad_s);
}

/// A word on the slip where it explains that nothing is seen.
std::string slip_remark(double slip) {
  constexpr double kSmall = 0.01;
  if (!(std::abs(slip) < kSmall)) return {};
  return fmt::format(" (slip {:.2g} %: load the motor, a rotor without current shows no T_R)", 100.0 * slip);
}

/// Not seen is what the noise leaves open, and both where an estimate is none.
void judge(ResistanceEstimate& e, double rotor_share, double slip) {
  if (!(e.stator_interval_ohm < kWidestShare * e.stator_resistance_ohm)) e.excitation.unseen.push_back("R_S");
  if (!(e.rotor_interval_s < kWidestShare * e.rotor_time_constant_s) || rotor_share < kLeastRotorShare)
    e.excitation.unseen.push_back("T_R");
  e.excitation.sufficient = e.excitation.unseen.empty();
  e.excitation.verdict = "the data see every parameter";
  if (e.excitation.sufficient) return;
  e.excitation.verdict = "not identifiable:";
  for (const std::string& name : e.excitation.unseen)
    e.excitation.verdict += " " + name;
  e.excitation.verdict +=
      rotor_share < kLeastRotorShare ? std::string(" (no slip, no current in the rotor)") : slip_remark(slip);
}

/// How far the speed moves between the first and the last tenth, over its mean.
double speed_change(std::span<const InductionInstant> instants) {
  const std::size_t part = std::max<std::size_t>(1, instants.size() / 10);
  double first = 0.0;
  double last = 0.0;
  for (std::size_t k = 0; k < part; ++k) {
    first += instants[k].speed;
    last += instants[instants.size() - 1 - k].speed;
  }
  const double mean = 0.5 * std::abs(first + last);
  return mean > 0.0 ? std::abs(last - first) / mean : 0.0;
}

/// The two equations of an instant: the columns of K_1, K_2, K_1 K_2, and y.
using TrackingRow = std::array<double, 4>;
std::array<TrackingRow, 2> rows_of(const InductionInstant& q, double pole_pairs, double inverse,
                                   double one_plus_beta_m) noexcept {
  const double we = pole_pairs * q.speed;
  return {{{-q.slope_x * inverse, one_plus_beta_m * (-q.slope_x + we * q.i_y) + q.u_x * inverse,
            -q.i_x * inverse, q.bend_x - we * q.slope_y - q.u_slope_x * inverse},
           {-q.slope_y * inverse, one_plus_beta_m * (-q.slope_y - we * q.i_x) + q.u_y * inverse,
            -q.i_y * inverse, q.bend_y + we * q.slope_x - q.u_slope_y * inverse}}};
}

/// The sums without what the noise adds to them, over `count` instants at this mean square electrical speed.
Sums<double> without_noise(Sums<double> s, const CurrentNoise& noise, double count, double speed2,
                           double inverse, double one_plus_beta_m) {
  const auto take = [&s, count](std::size_t a, std::size_t b, double of_a_row) {
    s[a][b] -= 2.0 * count * of_a_row;
    if (a != b) s[b][a] -= 2.0 * count * of_a_row;
  };
  take(0, 0, inverse * inverse * noise.slope_a2_s2);
  take(0, 1, inverse * one_plus_beta_m * noise.slope_a2_s2);
  take(1, 1, one_plus_beta_m * one_plus_beta_m * (noise.slope_a2_s2 + speed2 * noise.current_a2));
  take(2, 2, inverse * inverse * noise.current_a2);
  take(2, 3, -inverse * noise.current_bend_a2_s2);
  return s;
}

struct Matrix2 {
  double a, b, d;  ///< symmetric: a b, b d
  double determinant() const noexcept { return a * d - b * b; }
  bool is_positive() const noexcept { return a > 0.0 && determinant() > 1e-12 * a * d; }
};

Matrix2 half_hessian(const Sums<double>& s, const Point& p) {
  const auto h = hessian_at(s, p);
  return {.a = 0.5 * h[0][0], .b = 0.5 * h[0][1], .d = 0.5 * h[1][1]};
}

/// The zero of the compensated gradient next to the root of the raw one; nothing if it is no minimum with
/// positive resistances.
std::optional<Point> compensated(const Sums<double>& s, Point p) {
  const Conditions<double> conditions(s);
  constexpr int kSteps = 4;
  for (int step = 0; step < kSteps; ++step) {
    const Matrix2 h = half_hessian(s, p);
    if (!h.is_positive()) return std::nullopt;
    const double g1 = conditions.a1.at(p.k2) * p.k1 + conditions.a0.at(p.k2);
    const double g2 =
        (conditions.b2.at(p.k2) * p.k1 + conditions.b1.at(p.k2)) * p.k1 + conditions.b0.at(p.k2);
    p.k1 -= (h.d * g1 - h.b * g2) / h.determinant();
    p.k2 -= (h.a * g2 - h.b * g1) / h.determinant();
    if (!(p.k1 > 0.0 && p.k2 > 0.0)) return std::nullopt;
  }
  return half_hessian(s, p).is_positive() ? std::optional(p) : std::nullopt;
}

/// The data with white noise of this rms on the phase currents, the same for the same data.
MeasuredData with_noise(MeasuredData data, std::size_t phases, double rms_a) {
  std::mt19937 engine(1);
  const double width = std::sqrt(12.0) * rms_a / static_cast<double>(std::mt19937::max());
  for (std::size_t phase = 0; phase < phases; ++phase) {
    for (double& value : data.columns[phase].values)
      value += width * static_cast<double>(engine()) - 0.5 * std::sqrt(12.0) * rms_a;
  }
  return data;
}

/// The t quantile of 97.5 % for the degrees of freedom that kScoreParts leave for two parameters, 8.
constexpr double kStudent = 2.306;

/// Half of the 95 % intervals of K_1 and K_2 from the scatter of the scores between the parts.
std::array<double, 2> intervals_at(std::span<const TrackingRow> rows, const Point& p, const Matrix2& h) {
  std::array<std::array<double, 2>, kScoreParts> scores{};
  std::array<double, 2> mean{};
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const TrackingRow& r = rows[k];
    const double error = r[0] * p.k1 + r[1] * p.k2 + r[2] * p.k1 * p.k2 - r[3];
    std::array<double, 2>& score = scores[k * kScoreParts / rows.size()];
    score[0] += error * (r[0] + r[2] * p.k2);
    score[1] += error * (r[1] + r[2] * p.k1);
  }
  for (const auto& score : scores) {
    mean[0] += score[0] / static_cast<double>(kScoreParts);
    mean[1] += score[1] / static_cast<double>(kScoreParts);
  }
  std::array<double, 2> squares{};
  for (const auto& score : scores) {
    const double g1 = score[0] - mean[0];
    const double g2 = score[1] - mean[1];
    const double first = (h.d * g1 - h.b * g2) / h.determinant();
    const double second = (h.a * g2 - h.b * g1) / h.determinant();
    squares[0] += first * first;
    squares[1] += second * second;
  }
  constexpr double kFreedom = static_cast<double>(kScoreParts) / static_cast<double>(kScoreParts - 2);
  return {kStudent * std::sqrt(kFreedom * squares[0]), kStudent * std::sqrt(kFreedom * squares[1])};
}

}  // namespace

CurrentNoise filtered_noise(double rms_a, const LowPass& filter, double period_s) {
  const double reach = filter.cutoff_hz > 0.0 ? 4.0 / (filter.cutoff_hz * period_s) : 0.0;
  const auto half = static_cast<std::size_t>(reach) + 8;
  Series impulse(2 * half + 1, 0.0);
  impulse[half] = rms_a;
  const Series h = zero_phase(impulse, filter, period_s);
  const Series slope = central_difference(h, period_s);
  const Series bend = second_difference(h, period_s);
  CurrentNoise noise;
  for (std::size_t k = 0; k < h.size(); ++k) {
    noise.current_a2 += h[k] * h[k];
    noise.slope_a2_s2 += slope[k] * slope[k];
    noise.current_bend_a2_s2 += h[k] * bend[k];
  }
  return noise;
}

ResistanceEstimate identify_resistances(std::span<const InductionInstant> instants, double pole_pairs,
                                        const KnownInductances& known, const CurrentNoise& noise) {
  const double inverse = 1.0 / (known.leakage_factor * known.stator_inductance_h);
  const double one_plus_beta_m = 1.0 / known.leakage_factor;
  Regression fit({"R_S", "1/T_R", "R_S/T_R"});
  std::vector<TrackingRow> rows;
  rows.reserve(2 * instants.size());
  double speed2 = 0.0;
  for (const InductionInstant& q : instants) {
    for (const TrackingRow& row : rows_of(q, pole_pairs, inverse, one_plus_beta_m)) {
      fit.add(std::span(row).first<3>(), row[3]);
      rows.push_back(row);
    }
    speed2 += pole_pairs * pole_pairs * q.speed * q.speed / static_cast<double>(instants.size());
  }
  const Triangle r = fit.factor();
  for (std::size_t k = 0; k < 4; ++k) {
    for (std::size_t i = 0; i <= k; ++i) {
      if (!std::isfinite(r(i, k)))
        throw IdentificationError("the data contain values that are not finite, or too large");
    }
  }
  const auto entries = whole_entries(r);
  const Conditions<Whole> exact(sums_of<Whole>([&](std::size_t i, std::size_t j) { return entries[i][j]; }));
  const Polynomial<WholePolynomial> p1(std::vector<WholePolynomial>{exact.a0, exact.a1});
  const Polynomial<WholePolynomial> p2(std::vector<WholePolynomial>{exact.b0, exact.b1, exact.b2});
  const WholePolynomial eliminated = resultant(p1, p2);

  const Sums<double> raw = sums_of<double>([&](std::size_t i, std::size_t j) { return r(i, j); });
  const Conditions<double> conditions(raw);
  std::optional<Point> best;
  for (const PositiveRoot& root : positive_roots(eliminated).roots) {
    Point p = {.k1 = -conditions.a0.at(root.value) / conditions.a1.at(root.value),
               .k2 = root.value,
               .residual = 0.0};
    p.residual = residual_at(r, p.k1, p.k2);
    if (p.k1 > 0.0 && (!best || p.residual < best->residual)) best = p;
  }
  ResistanceEstimate estimate;
  estimate.degree = eliminated.degree();
  if (const double change = speed_change(instants); change > kMostSpeedChange) {
    estimate.excitation = {.sufficient = false,
                           .unseen = {"R_S", "T_R"},
                           .verdict = "not identifiable: the speed changes within the window"};
    return estimate;
  }
  const Sums<double> s =
      without_noise(raw, noise, static_cast<double>(instants.size()), speed2, inverse, one_plus_beta_m);
  if (best) best = compensated(s, *best);
  if (!best) {
    estimate.excitation = {.sufficient = false,
                           .unseen = {"R_S", "T_R"},
                           .verdict = "not identifiable: no resistances above zero fit the data" +
                                      slip_remark(slip_of(instants, pole_pairs))};
    return estimate;
  }
  const double residual = residual_at(r, best->k1, best->k2);
  const double tr = 1.0 / best->k2;
  const auto far = reach(hessian_at(s, *best), {{1.0, 0.0}, {0.0, -tr * tr}}, 0.5 * residual);
  const std::array<double, 2> intervals = intervals_at(rows, *best, half_hessian(s, *best));
  estimate.stator_resistance_ohm = best->k1;
  estimate.rotor_time_constant_s = tr;
  estimate.stator_interval_ohm = intervals[0];
  estimate.rotor_interval_s = tr * tr * intervals[1];
  estimate.stator_index_ohm = far[0];
  estimate.rotor_index_s = far[1];
  estimate.error_index = raw[3][3] > 0.0 ? std::sqrt(residual / raw[3][3]) : 0.0;
  const double open = raw[1][1];
  const double seen = raw[1][1] + best->k1 * (2.0 * raw[1][2] + best->k1 * raw[2][2]);
  judge(estimate, open > 0.0 ? std::sqrt(std::max(0.0, seen) / open) : 0.0, slip_of(instants, pole_pairs));
  return estimate;
}

Processing tracking_processing(double cutoff_hz, double period_s, double voltage_shift) {
  Processing p{.voltage_shift = voltage_shift};
  p.current = p.voltage = p.shaft = {.order = 3, .cutoff_hz = cutoff_hz};
  const double memory = cutoff_hz > 0.0 ? 1.0 / (cutoff_hz * period_s) : 0.0;
  p.edge_samples = std::max(p.edge_samples, static_cast<std::size_t>(std::ceil(memory)));
  return p;
}

ResistanceTracker::ResistanceTracker(const Options& options) : options_(options) {
  if (!(options.period_s > 0.0)) throw IdentificationError("the period of a tracker must be positive");
  if (options.window < 50 || options.stride < 1)
    throw IdentificationError("a tracker needs a window of 50 samples and a stride of one at least");
  if (!(options.known.stator_inductance_h > 0.0 && options.known.leakage_factor > 0.0 &&
        options.known.leakage_factor < 1.0))
    throw IdentificationError("a tracker needs L_S > 0 and 0 < sigma < 1");
  options_.settings.processing.from_s = options_.settings.processing.to_s = 0.0;
  kept_ = options.window + 2 * options.settings.processing.edge_samples;
  unit_noise_ = filtered_noise(1.0, options.settings.processing.current, options.period_s);
  data_.period_s = options.period_s;
  const char* shaft = options.settings.counts_per_revolution > 0.0 ? "encoder_count" : "angle_rad";
  for (const char* name : {"i_a_a", "i_b_a", "i_c_a", "u_a_v", "u_b_v", "u_c_v", shaft})
    data_.columns.push_back({name, "", {}});
}

void ResistanceTracker::restart() noexcept {
  since_ = 0;
  for (Column& column : data_.columns)
    column.values.clear();
}

std::optional<ResistanceEstimate> ResistanceTracker::push(const Reading& x) {
  const std::array values = {x.i_a, x.i_b, x.i_c, x.u_a, x.u_b, x.u_c, x.shaft};
  for (std::size_t k = 0; k < values.size(); ++k)
    data_.columns[k].values.push_back(values[k]);
  ++since_;
  if (data_.samples() < kept_ || since_ < options_.stride) return std::nullopt;
  since_ = 0;
  for (Column& column : data_.columns)
    column.values.erase(column.values.begin(), column.values.end() - static_cast<std::ptrdiff_t>(kept_));
  double rounding_a = 0.0;
  for (std::size_t k = 0; k < phases(); ++k)
    rounding_a = std::max(rounding_a, rounding_without_noise(data_.columns[k].values));
  ResistanceEstimate estimate = estimate_of(data_);
  if (rounding_a == 0.0 || estimate.stator_resistance_ohm == 0.0) return estimate;
  // Steps that no noise rounds off err alike in every window, so that their scatter tells nothing. Noise of
  // twice their rms, added for the intervals alone, errs farther in all that a search found.
  const ResistanceEstimate shaken = estimate_of(with_noise(data_, phases(), 6.0 * rounding_a));
  estimate.stator_interval_ohm = shaken.stator_interval_ohm;
  estimate.rotor_interval_s = shaken.rotor_interval_s;
  estimate.excitation = shaken.excitation;
  return estimate;
}

std::size_t ResistanceTracker::phases() const noexcept {
  return options_.settings.three_phase ? 3 : 2;
}

ResistanceEstimate ResistanceTracker::estimate_of(const MeasuredData& data) const {
  const SampleRange range = window_of(data, options_.settings.processing);
  const std::vector<InductionInstant> instants = induction_instants(data, options_.settings);
  double squares = 0.0;
  for (std::size_t k = 0; k < phases(); ++k) {
    const double noise_a = white_noise(data.columns[k].values);
    squares += noise_a * noise_a / static_cast<double>(phases());
  }
  const CurrentNoise noise = {.current_a2 = squares * unit_noise_.current_a2,
                              .slope_a2_s2 = squares * unit_noise_.slope_a2_s2,
                              .current_bend_a2_s2 = squares * unit_noise_.current_bend_a2_s2};
  return identify_resistances(std::span(instants).subspan(range.first, range.count()),
                              options_.settings.pole_pairs, options_.known, noise);
}

}  // namespace drivebench::identification
