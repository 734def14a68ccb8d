#include "clients/identification/motors/induction/induction_regressor.hpp"

namespace drivebench::identification {
namespace {

/// One row for the components along (i, ...) and across (j, ...); `sign` is +1 in the x row and -1 in the y
/// row.
struct RowSignals {
  double i, slope, bend, u, u_slope;
  double j, j_slope, v;
  double sign;
};

std::array<double, kInductionParameters> row_of(const RowSignals& r, double n, double w, double dw) noexcept {
  const double we = n * w;  // electrical speed
  const double we2 = we * we;
  const double we3 = we2 * we;
  const double s = r.sign;
  return {-r.slope,
          we2 * r.i,
          r.u_slope,
          r.i,
          s * we * r.j - r.slope,
          -r.i,
          s * we * r.j,
          -we2 * r.slope + s * we3 * r.j + dw * (s * n * r.j_slope + n * we * r.i),
          s * n * r.j * dw - we2 * r.i,
          s * we3 * r.j,
          n * n * (w * r.slope * dw - w * w * r.bend) + s * we3 * r.j_slope,
          n * n * (w * r.i * dw - w * w * r.slope),
          n * n * (w * w * r.u_slope - r.u * w * dw),
          r.u,
          we2 * r.u - s * n * r.v * dw};
}

}  // namespace

InductionEquations induction_equations(const InductionInstant& q, double n) noexcept {
  const double w = q.speed;
  const double dw = q.acceleration;
  const RowSignals x = {q.i_x, q.slope_x, q.bend_x, q.u_x, q.u_slope_x, q.i_y, q.slope_y, q.u_y, 1.0};
  const RowSignals y = {q.i_y, q.slope_y, q.bend_y, q.u_y, q.u_slope_y, q.i_x, q.slope_x, q.u_x, -1.0};
  return {.x_row = row_of(x, n, w, dw),
          .y_row = row_of(y, n, w, dw),
          .x = q.bend_x - n * q.i_y * dw - n * w * q.slope_y,
          .y = q.bend_y + n * q.i_x * dw + n * w * q.slope_x};
}

std::vector<InductionInstant> induction_instants(const MeasuredData& data, const Settings& e) {
  const Processing& p = e.processing;
  const double period = data.period_s;
  const ShaftSignals shaft = shaft_signals(data, e, p.shaft);
  Series electrical = shaft.angle;
  for (double& angle : electrical)
    angle *= e.pole_pairs;
  TwoPhaseSeries u = windings(data, e, 'u', 'v');
  u = rotated({.a = advanced(u.a, p.voltage_shift), .b = advanced(u.b, p.voltage_shift)}, electrical);
  u = {.a = zero_phase(u.a, p.voltage, period), .b = zero_phase(u.b, p.voltage, period)};
  TwoPhaseSeries i = rotated(windings(data, e, 'i', 'a'), electrical);
  i = {.a = zero_phase(i.a, p.current, period), .b = zero_phase(i.b, p.current, period)};
  const TwoPhaseSeries slope = {.a = slope_of(i.a, data, p), .b = slope_of(i.b, data, p)};
  const auto bend_of = [&](const Series& x, const Series& dx) {
    return p.backward_differences ? backward_difference(dx, period) : second_difference(x, period);
  };
  const TwoPhaseSeries bend = {.a = bend_of(i.a, slope.a), .b = bend_of(i.b, slope.b)};
  const TwoPhaseSeries u_slope = {.a = slope_of(u.a, data, p), .b = slope_of(u.b, data, p)};
  std::vector<InductionInstant> instants(data.samples());
  for (std::size_t k = 0; k < instants.size(); ++k) {
    instants[k] = {i.a[k], i.b[k], slope.a[k],   slope.b[k],   bend.a[k],      bend.b[k],
                   u.a[k], u.b[k], u_slope.a[k], u_slope.b[k], shaft.speed[k], shaft.acceleration[k]};
  }
  return instants;
}

std::vector<std::string> induction_parameter_names() {
  std::vector<std::string> names;
  for (std::size_t j = 1; j <= kInductionParameters; ++j)
    names.push_back("K" + std::to_string(j));
  return names;
}

}  // namespace drivebench::identification
