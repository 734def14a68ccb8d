#include "plant/machines/saturated_induction/saturated_induction_machine.hpp"

#include <algorithm>
#include <limits>
#include <vector>

#include "plant/machines/induction/induction_machine.hpp"

namespace drivebench {
namespace {

using Constants = SaturatedInductionMachineConstants;
using State = SaturatedInductionMachineState;

double square(TwoPhase x) noexcept {
  return x.a * x.a + x.b * x.b;
}

/// The magnetising flux where stator current and rotor flux are known: it follows s = i_S + lambda_R/l_r.
struct MagneticState {
  double chord_h;       ///< flux over s
  double anisotropy_h;  ///< inductance to small changes along s less that across it
  TwoPhase total_a;     ///< s
  double square_a2;     ///< |s|^2
};

MagneticState magnetic_state(const Constants& c, TwoPhase stator_a, TwoPhase rotor_wb) noexcept {
  const TwoPhase total_a{.a = stator_a.a + rotor_wb.a * c.rotor_leakage_per_h,
                         .b = stator_a.b + rotor_wb.b * c.rotor_leakage_per_h};
  const double square_a2 = square(total_a);
  const auto [chord_h, slope_h] =
      saturation_detail::inductances(c.points, c.rotor_leakage_h, std::sqrt(square_a2));
  return {.chord_h = chord_h, .anisotropy_h = slope_h - chord_h, .total_a = total_a, .square_a2 = square_a2};
}

/// Rate of the magnetising flux for a rate of s.
TwoPhase magnetising_rate(const MagneticState& m, TwoPhase rate) noexcept {
  const double along = m.total_a.a * rate.a + m.total_a.b * rate.b;
  const double more = m.square_a2 > 0.0 ? m.anisotropy_h * along / m.square_a2 : 0.0;
  return {.a = m.chord_h * rate.a + more * m.total_a.a, .b = m.chord_h * rate.b + more * m.total_a.b};
}

TwoPhase rotor_wb(const State& x) noexcept {
  return {.a = x.rotor_a_wb, .b = x.rotor_b_wb};
}

TwoPhase rotor_current_a(const Constants& c, const State& x) noexcept {
  const TwoPhase flux_wb = saturation_detail::magnetising_flux_wb(c, x);
  return {.a = (x.rotor_a_wb - flux_wb.a) * c.rotor_leakage_per_h,
          .b = (x.rotor_b_wb - flux_wb.b) * c.rotor_leakage_per_h};
}

}  // namespace

SaturatedInductionMachineConstants constants_of(const SaturatedInductionMachineParameters& p) noexcept {
  return {
      .pole_pairs = static_cast<double>(p.pole_pairs),
      .stator_resistance_ohm = p.stator_resistance_ohm,
      .rotor_resistance_ohm = p.rotor_resistance_ohm,
      .stator_leakage_h = p.stator_leakage_h,
      .rotor_leakage_h = p.rotor_leakage_h,
      .stator_leakage_per_h = 1.0 / p.stator_leakage_h,
      .rotor_leakage_per_h = 1.0 / p.rotor_leakage_h,
      .parallel_leakage_h = p.stator_leakage_h * p.rotor_leakage_h / (p.stator_leakage_h + p.rotor_leakage_h),
      .magnetising_curve = p.magnetising_curve,
      .points = p.magnetising_curve.points()};
}

const CurvePoint* saturation_detail::segment(std::span<const CurvePoint> points, double leakage_h,
                                             double total_a) noexcept {
  const auto after = std::upper_bound(
      points.begin() + 1, points.end() - 1, total_a * leakage_h,
      [leakage_h](double at_wb, const CurvePoint& p) { return at_wb < p.y + leakage_h * p.x; });
  return &*after - 1;
}

/// With the current slope i' n along the line, all of s changes by i' n + lambda_R'/l_r, and along the line
/// l_s i' + n·lambda_m' is what the voltage leaves; across it the flux follows lambda_m alone.
SaturatedInductionMachineState saturation_detail::blocked(const Constants& c, const State& x,
                                                          const State& slope,
                                                          const TerminalInput& u) noexcept {
  const MagneticState m = magnetic_state(c, saturation_detail::stator_current_a(c, x), rotor_wb(x));
  const TwoPhase flux_rate = magnetising_rate(
      m, {.a = slope.rotor_a_wb * c.rotor_leakage_per_h, .b = slope.rotor_b_wb * c.rotor_leakage_per_h});
  State result = slope;
  result.stator_a_wb = flux_rate.a;
  result.stator_b_wb = flux_rate.b;
  if (u.conduction == Conduction::kLine) {
    const TwoPhase n = u.line;
    const TwoPhase unit_rate = magnetising_rate(m, n);
    const double left_v = n.a * (slope.stator_a_wb - flux_rate.a) + n.b * (slope.stator_b_wb - flux_rate.b);
    const double current_slope = left_v / (c.stator_leakage_h + n.a * unit_rate.a + n.b * unit_rate.b);
    result.stator_a_wb += current_slope * (c.stator_leakage_h * n.a + unit_rate.a);
    result.stator_b_wb += current_slope * (c.stator_leakage_h * n.b + unit_rate.b);
  }
  return result;
}

SaturatedInductionMachineState restricted(const Constants& c, const State& x, const RotorMotion&,
                                          const TerminalInput& u) noexcept {
  if (u.conduction == Conduction::kFull) return x;
  const TwoPhase stator_a = conducted(saturation_detail::stator_current_a(c, x), u);
  const MagneticState m = magnetic_state(c, stator_a, rotor_wb(x));
  State result = x;
  result.stator_a_wb = c.stator_leakage_h * stator_a.a + m.chord_h * m.total_a.a;
  result.stator_b_wb = c.stator_leakage_h * stator_a.b + m.chord_h * m.total_a.b;
  return result;
}

WindingValues open_circuit_voltages(const Constants& c, const State& x, const RotorMotion& motion) noexcept {
  const TerminalInput open{.conduction = Conduction::kNone};
  const State slope = derivative(c, x, motion, open);
  return {.stator = {.a = slope.stator_a_wb, .b = slope.stator_b_wb}};
}

WindingValues winding_voltages(const Constants& c, const State& x, const RotorMotion& motion,
                               const TerminalInput& u) noexcept {
  const State slope = derivative(c, x, motion, u);
  const TwoPhase stator_a = saturation_detail::stator_current_a(c, x);
  return {.stator = {.a = c.stator_resistance_ohm * stator_a.a + slope.stator_a_wb,
                     .b = c.stator_resistance_ohm * stator_a.b + slope.stator_b_wb}};
}

TwoPhase rotor_flux_wb(const Constants&, const State& x, const RotorMotion&) noexcept {
  return rotor_wb(x);
}

double stored_energy_j(const Constants& c, const State& x, const RotorMotion&) noexcept {
  const TwoPhase stator_a = saturation_detail::stator_current_a(c, x);
  const TwoPhase rotor_a = rotor_current_a(c, x);
  const double flux_wb = std::sqrt(square(saturation_detail::magnetising_flux_wb(c, x)));
  const double current_a = c.magnetising_curve.inverse(flux_wb);
  return 0.5 * c.stator_leakage_h * square(stator_a) + 0.5 * c.rotor_leakage_h * square(rotor_a) +
         (flux_wb * current_a - c.magnetising_curve.area(current_a));
}

double losses_w(const Constants& c, const State& x, const RotorMotion&) noexcept {
  return c.stator_resistance_ohm * square(saturation_detail::stator_current_a(c, x)) +
         c.rotor_resistance_ohm * square(rotor_current_a(c, x));
}

Connection connection_of(const SaturatedInductionMachineParameters& p) noexcept {
  return p.star ? Connection::kStar : Connection::kTwoPhase;
}

double pole_pairs_of(const SaturatedInductionMachineParameters&) noexcept {
  return 0.0;
}

SaturatedInductionMachineParameters adjusted(const SaturatedInductionMachineParameters& p,
                                             const Adjustment& a) noexcept {
  SaturatedInductionMachineParameters result = p;
  result.stator_resistance_ohm =
      p.stator_resistance_ohm * a.stator_resistance_factor + a.series_resistance_ohm;
  result.rotor_resistance_ohm = p.rotor_resistance_ohm * a.rotor_resistance_factor;
  result.stator_leakage_h = p.stator_leakage_h + a.series_inductance_h;
  return result;
}

/// With the least slope M of the curve every mode decays fastest: the inductances are smallest.
double fastest_time_constant_s(const SaturatedInductionMachineParameters& p) noexcept {
  double least_h = std::numeric_limits<double>::infinity();
  const std::vector<CurvePoint>& points = p.magnetising_curve.points();
  for (std::size_t n = 1; n < points.size(); ++n)
    least_h = std::min(least_h, (points[n].y - points[n - 1].y) / (points[n].x - points[n - 1].x));
  return fastest_time_constant_s(
      InductionMachineParameters{.stator_resistance_ohm = p.stator_resistance_ohm,
                                 .rotor_resistance_ohm = p.rotor_resistance_ohm,
                                 .stator_inductance_h = p.stator_leakage_h + least_h,
                                 .rotor_inductance_h = p.rotor_leakage_h + least_h,
                                 .mutual_inductance_h = least_h});
}

}  // namespace drivebench
