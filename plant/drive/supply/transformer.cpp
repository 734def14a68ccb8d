#include "plant/drive/supply/transformer.hpp"

namespace drivebench {

TransformerConstants constants_of(const TransformerParameters& p) noexcept {
  if (!has_transformer(p)) return {};
  const double primary_h = p.primary_leakage_h + p.magnetising_inductance_h;
  const double coupling = p.magnetising_inductance_h / primary_h;
  const double gain = coupling * p.turns_ratio;
  return {.gain = gain,
          .decay_per_s = p.primary_resistance_ohm / primary_h,
          .coupling_ohm = gain * p.primary_resistance_ohm,
          .resistance_ohm = p.secondary_resistance_ohm + gain * gain * p.primary_resistance_ohm,
          .inductance_h = p.secondary_leakage_h + gain * p.turns_ratio * p.primary_leakage_h};
}

Course flux_course_wb(const TransformerConstants& c, double flux_wb, const Course& primary_v,
                      const Course& secondary_a, double duration_s) noexcept {
  const auto slope_v = [&c](double flux, double v, double i) {
    return v - c.decay_per_s * flux - c.coupling_ohm * i;
  };
  const double half_s = 0.5 * duration_s;
  const double k1 = slope_v(flux_wb, primary_v.start, secondary_a.start);
  const double k2 = slope_v(flux_wb + half_s * k1, primary_v.middle, secondary_a.middle);
  const double k3 = slope_v(flux_wb + half_s * k2, primary_v.middle, secondary_a.middle);
  const double k4 = slope_v(flux_wb + duration_s * k3, primary_v.end, secondary_a.end);
  const double end_wb = flux_wb + duration_s / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
  // In the middle the cubic through the values and slopes of both ends.
  const double end_slope_v = slope_v(end_wb, primary_v.end, secondary_a.end);
  const double middle_wb = 0.5 * (flux_wb + end_wb) + 0.125 * duration_s * (k1 - end_slope_v);
  return {.start = flux_wb, .middle = middle_wb, .end = end_wb};
}

Course secondary_course_v(const TransformerConstants& c, const TransformerPhase& x, const Course& primary_v,
                          double current_a, double duration_s) noexcept {
  const Course foreseen = {.start = current_a,
                           .middle = foreseen_a(x.current, current_a, 0.5 * duration_s),
                           .end = foreseen_a(x.current, current_a, duration_s)};
  const Course flux_wb = flux_course_wb(c, x.flux_wb, primary_v, foreseen, duration_s);
  const auto voltage_v = [&c](double v, double flux) { return c.gain * (v - c.decay_per_s * flux); };
  return {.start = voltage_v(primary_v.start, flux_wb.start),
          .middle = voltage_v(primary_v.middle, flux_wb.middle),
          .end = voltage_v(primary_v.end, flux_wb.end)};
}

TransformerPhase magnetised(const TransformerConstants& c, const TransformerPhase& x, const Course& primary_v,
                            double from_a, double to_a, double duration_s) noexcept {
  const CurrentTrend trend = followed(x.current, from_a, to_a, duration_s);
  const Course passed_a = {.start = from_a,
                           .middle = 0.5 * (from_a + to_a) - 0.25 * trend.bend_a_s2 * duration_s * duration_s,
                           .end = to_a};
  return {.flux_wb = flux_course_wb(c, x.flux_wb, primary_v, passed_a, duration_s).end, .current = trend};
}

}  // namespace drivebench
