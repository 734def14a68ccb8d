#include "plant/sensors/meter.hpp"

#include <algorithm>
#include <cmath>

namespace drivebench {
namespace {

/// Phase quantities in power-invariant coordinates; a star has no zero sequence (its neutral floats).
struct Invariant {
  double a;
  double b;
  double zero;
};

Invariant invariant(Connection connection, const PhaseValues& x) noexcept {
  if (connection == Connection::kArmature) return {.a = x.a, .b = 0.0, .zero = 0.0};
  if (connection == Connection::kTwoPhase) return {.a = x.a, .b = x.b, .zero = 0.0};
  const TwoPhase plane = three_to_two({x.a, x.b, x.c});
  const bool has_zero = connection == Connection::kIndependent;
  return {.a = plane.a, .b = plane.b, .zero = has_zero ? frames_detail::kRootThird * (x.a + x.b + x.c) : 0.0};
}

double dot(const Invariant& x, const Invariant& y) noexcept {
  return x.a * y.a + x.b * y.b + x.zero * y.zero;
}

/// The plane area between two vectors, positive where y is ahead of x.
double cross(const Invariant& x, const Invariant& y) noexcept {
  return x.a * y.b - x.b * y.a;
}

Invariant difference(const Invariant& x, const Invariant& y) noexcept {
  return {.a = x.a - y.a, .b = x.b - y.b, .zero = x.zero - y.zero};
}

}  // namespace

void add_interval(MeterSums& sums, Connection connection, double duration_s, const TerminalPoint& from,
                  const TerminalPoint& to) noexcept {
  const Invariant u0 = invariant(connection, from.voltage_v);
  const Invariant u1 = invariant(connection, to.voltage_v);
  const Invariant i0 = invariant(connection, from.current_a);
  const Invariant i1 = invariant(connection, to.current_a);
  const Invariant di = difference(i1, i0);
  const bool stands = u0.a == u1.a && u0.b == u1.b && u0.zero == u1.zero;
  const double half_s = 0.5 * duration_s;
  sums.voltage_v2s += half_s * (dot(u0, u0) + dot(u1, u1));
  sums.current_a2s += half_s * (dot(i0, i0) + dot(i1, i1) - (stands ? dot(di, di) / 3.0 : 0.0));
  sums.energy_j += half_s * (dot(u0, i0) + dot(u1, i1));
  sums.reactive_vars += half_s * (cross(i0, u0) + cross(i1, u1));
  sums.turning += connection == Connection::kArmature ? (u0.a + u1.a) * di.a : cross(i0, i1);
  sums.time_s += duration_s;
}

MeterFigures figures_of(const MeterSums& sums, Connection connection) noexcept {
  if (!(sums.time_s > 0.0)) return {};
  const double phases = terminal_count(connection);
  const double per_phase = 1.0 / (phases * sums.time_s);
  MeterFigures figures{.voltage_v = std::sqrt(sums.voltage_v2s * per_phase),
                       .current_a = std::sqrt(std::max(sums.current_a2s, 0.0) * per_phase),
                       .power_w = sums.energy_j / sums.time_s};
  const double apparent_va = phases * figures.voltage_v * figures.current_a;
  if (connection == Connection::kArmature) {
    const double squared = apparent_va * apparent_va - figures.power_w * figures.power_w;
    figures.reactive_var = std::sqrt(std::max(squared, 0.0)) * (sums.turning < 0.0 ? -1.0 : 1.0);
  } else {
    figures.reactive_var = sums.reactive_vars / sums.time_s * (sums.turning < 0.0 ? -1.0 : 1.0);
  }
  if (apparent_va > 0.0) figures.power_factor = figures.power_w / apparent_va;
  return figures;
}

}  // namespace drivebench
