#include "clients/identification/motors/resistance_tracking.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "clients/identification/math/real_roots.hpp"

namespace drivebench::identification {
namespace {

/// Below this part of what the column of 1/T_R would be with the rotor open, its current is too small to see.
constexpr double kLeastRotorShare = 0.02;
constexpr double kLargestIndex = 0.5;

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

void judge(ResistanceEstimate& e, double rotor_share) {
  if (!(e.stator_index_ohm < kLargestIndex * e.stator_resistance_ohm)) e.excitation.unseen.push_back("R_S");
  if (!(e.rotor_index_s < kLargestIndex * e.rotor_time_constant_s) || rotor_share < kLeastRotorShare)
    e.excitation.unseen.push_back("T_R");
  e.excitation.sufficient = e.excitation.unseen.empty();
  e.excitation.verdict = "the data see every parameter";
  if (e.excitation.sufficient) return;
  e.excitation.verdict = "not identifiable:";
  for (const std::string& name : e.excitation.unseen)
    e.excitation.verdict += " " + name;
  if (rotor_share < kLeastRotorShare) e.excitation.verdict += " (no slip, no current in the rotor)";
}

}  // namespace

ResistanceEstimate identify_resistances(std::span<const InductionInstant> instants, double pole_pairs,
                                        const KnownInductances& known) {
  const double inverse = 1.0 / (known.leakage_factor * known.stator_inductance_h);
  const double one_plus_beta_m = 1.0 / known.leakage_factor;
  Regression fit({"R_S", "1/T_R", "R_S/T_R"});
  for (const InductionInstant& q : instants) {
    const double we = pole_pairs * q.speed;
    fit.add(std::array{-q.slope_x * inverse, one_plus_beta_m * (-q.slope_x + we * q.i_y) + q.u_x * inverse,
                       -q.i_x * inverse},
            q.bend_x - we * q.slope_y - q.u_slope_x * inverse);
    fit.add(std::array{-q.slope_y * inverse, one_plus_beta_m * (-q.slope_y - we * q.i_x) + q.u_y * inverse,
                       -q.i_y * inverse},
            q.bend_y + we * q.slope_x - q.u_slope_y * inverse);
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

  const Sums<double> s = sums_of<double>([&](std::size_t i, std::size_t j) { return r(i, j); });
  const Conditions<double> conditions(s);
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
  if (!best) {
    estimate.excitation = {.sufficient = false,
                           .unseen = {"R_S", "T_R"},
                           .verdict = "not identifiable: no resistances above zero fit the data"};
    return estimate;
  }
  const double tr = 1.0 / best->k2;
  const auto far = reach(hessian_at(s, *best), {{1.0, 0.0}, {0.0, -tr * tr}}, 0.5 * best->residual);
  estimate.stator_resistance_ohm = best->k1;
  estimate.rotor_time_constant_s = tr;
  estimate.stator_index_ohm = far[0];
  estimate.rotor_index_s = far[1];
  estimate.error_index = s[3][3] > 0.0 ? std::sqrt(best->residual / s[3][3]) : 0.0;
  const double open = s[1][1];
  const double seen = s[1][1] + best->k1 * (2.0 * s[1][2] + best->k1 * s[2][2]);
  judge(estimate, open > 0.0 ? std::sqrt(std::max(0.0, seen) / open) : 0.0);
  return estimate;
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
  data_.period_s = options.period_s;
  const char* shaft = options.settings.counts_per_revolution > 0.0 ? "encoder_count" : "angle_rad";
  for (const char* name : {"i_a_a", "i_b_a", "i_c_a", "u_a_v", "u_b_v", "u_c_v", shaft})
    data_.columns.push_back({name, "", {}});
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
  const SampleRange range = window_of(data_, options_.settings.processing);
  const std::vector<InductionInstant> instants = induction_instants(data_, options_.settings);
  return identify_resistances(std::span(instants).subspan(range.first, range.count()),
                              options_.settings.pole_pairs, options_.known);
}

}  // namespace drivebench::identification
