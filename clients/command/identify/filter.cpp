#include "clients/command/identify/filter.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <complex>
#include <numbers>
#include <string>
#include <vector>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/json.hpp"
#include "clients/command/common/basics/output.hpp"
#include "clients/identification/data/measured_data.hpp"
#include "clients/identification/data/signals.hpp"
#include "clients/identification/math/filters.hpp"
#include "plant/math/trig.hpp"
#include "protocols/json.hpp"

namespace drivebench::command {
namespace {

using identification::AnalogFilter;
using identification::DigitalFilter;
using identification::Series;

constexpr double kPi = std::numbers::pi;

/// All sections as one polynomial, which double precision holds up to order 10.
AnalogFilter whole_of(const std::vector<AnalogFilter>& sections) {
  AnalogFilter whole = {.numerator = {1.0}, .denominator = {1.0}};
  for (const AnalogFilter& section : sections) {
    whole.numerator[0] *= section.numerator[0];
    std::vector<double> product(whole.denominator.size() + section.denominator.size() - 1, 0.0);
    for (std::size_t i = 0; i < whole.denominator.size(); ++i) {
      for (std::size_t j = 0; j < section.denominator.size(); ++j)
        product[i + j] += whole.denominator[i] * section.denominator[j];
    }
    whole.denominator = std::move(product);
  }
  return whole;
}

double gain_at(const AnalogFilter& filter, double rad_s) {
  std::complex<double> value = 0.0;
  for (const double c : filter.denominator)
    value = value * std::complex<double>(0.0, rad_s) + c;
  return filter.numerator[0] / std::abs(value);
}

/// The numbers that are printed.
struct Numbers {
  std::array<double, 3> gains{};  ///< |G| at 0.6, 1 and 2 times the corner
  double delay_s = 0.0;           ///< of low frequencies
  DigitalFilter plain;            ///< by the trapezoidal rule
  double plain_corner_hz = 0.0;   ///< where that one has 1/√2
  DigitalFilter exact;            ///< the same, right at the corner
};

Numbers numbers_of(const FilterOptions& o) {
  const double corner_rad_s = 2.0 * kPi * o.cutoff_hz;
  const AnalogFilter whole = whole_of(identification::butterworth_sections(o.order, corner_rad_s));
  const double period_s = 1.0 / o.rate_hz;
  Numbers n;
  n.gains = {gain_at(whole, 0.6 * corner_rad_s), gain_at(whole, corner_rad_s),
             gain_at(whole, 2.0 * corner_rad_s)};
  n.delay_s = 1.0 / sine(kPi / (2.0 * o.order)) / corner_rad_s;
  n.plain = identification::bilinear(whole, period_s);
  n.plain_corner_hz = o.rate_hz / kPi * arctangent2(kPi * o.cutoff_hz, o.rate_hz);
  n.exact = identification::bilinear(whole, period_s, corner_rad_s);
  return n;
}

/// The row that gives the output of the controllable canonical form: b_i − b_0·a_i, i = n .. 1.
std::vector<double> output_row(const DigitalFilter& filter) {
  std::vector<double> row;
  for (std::size_t i = filter.b.size(); i-- > 1;)
    row.push_back(filter.b[i] - filter.b[0] * filter.a[i]);
  return row;
}

void print_digital(const char* name, const DigitalFilter& filter) {
  fmt::print("{}\n  b  {:.6e}\n  a  {:.9f}\n", name, fmt::join(filter.b, "  "), fmt::join(filter.a, "  "));
  fmt::print("  as states: last row of A {:.9f}; c {:.6e}; d {:.6e}\n",
             fmt::join(std::vector<double>(filter.a.rbegin(), filter.a.rend() - 1), "  "),
             fmt::join(output_row(filter), "  "), filter.b[0]);
}

void print_numbers(const FilterOptions& o, const Numbers& n) {
  fmt::print("Butterworth low-pass, order {}, corner {:g} Hz, sampled at {:g} Hz\n", o.order, o.cutoff_hz,
             o.rate_hz);
  fmt::print("  gain at 0.6, 1 and 2 times the corner   {:.4f}  {:.4f}  {:.4f}\n", n.gains[0], n.gains[1],
             n.gains[2]);
  fmt::print("  there and back, without a phase         {:.4f}  {:.4f}  {:.4f}\n", n.gains[0] * n.gains[0],
             n.gains[1] * n.gains[1], n.gains[2] * n.gains[2]);
  fmt::print("  delay of low frequencies                {:.4g} ms\n", 1e3 * n.delay_s);
  print_digital(fmt::format("trapezoidal rule, corner at {:.3f} Hz", n.plain_corner_hz).c_str(), n.plain);
  print_digital("trapezoidal rule, exact at the corner", n.exact);
}

Json json_of(const DigitalFilter& filter) {
  return {{"b", filter.b}, {"a", filter.a}, {"c", output_row(filter)}, {"d", filter.b[0]}};
}

void print_json(const FilterOptions& o, const Numbers& n) {
  const Json out = {{"order", o.order},
                    {"cutoff_hz", o.cutoff_hz},
                    {"rate_hz", o.rate_hz},
                    {"gains", n.gains},
                    {"delay_s", n.delay_s},
                    {"trapezoidal", json_of(n.plain)},
                    {"trapezoidal_corner_hz", n.plain_corner_hz},
                    {"exact_at_corner", json_of(n.exact)}};
  fmt::print("{}\n", json_text(out));
}

/// The column filtered once, as a controller could, and there and back; and the slope of the latter.
int filter_file(const FilterOptions& o) {
  const identification::MeasuredData data =
      identification::read_csv(o.file, {.columns = {{.name = "x", .header = o.column}}, .time = o.time});
  const identification::SeriesView x = data.at("x");
  const double rate_hz = 1.0 / data.period_s;
  if (o.rate_hz > 0.0 && std::abs(o.rate_hz / rate_hz - 1.0) > 0.01)
    throw UsageError(
        fmt::format("--rate-hz is {:g}, but the rows of {} come at {:g} Hz", o.rate_hz, o.file, rate_hz));
  const Series there_and_back =
      identification::zero_phase(x, {.order = o.order, .cutoff_hz = o.cutoff_hz}, data.period_s);
  const Series slope = identification::central_difference(there_and_back, data.period_s);
  const double corner_rad_s = 2.0 * kPi * o.cutoff_hz;
  Series once(x.begin(), x.end());
  for (const AnalogFilter& section : identification::butterworth_sections(o.order, corner_rad_s)) {
    identification::StateSpaceFilter filter(identification::bilinear(section, data.period_s, corner_rad_s));
    filter.settle(once.front());
    for (double& value : once)
      value = filter.step(value);
  }
  Output out(o.out_file);
  out.write(fmt::format("time_s,{0},{0}_once,{0}_zero_phase,{0}_slope\n", o.column));
  for (std::size_t k = 0; k < x.size(); ++k) {
    out.write(fmt::format("{},{},{},{},{}\n", static_cast<double>(k) * data.period_s, x[k], once[k],
                          there_and_back[k], slope[k]));
  }
  out.flush();
  return kExitOk;
}

}  // namespace

int run_filter(const FilterOptions& options) {
  if (!options.file.empty()) {
    if (options.column.empty()) throw UsageError("a file needs --column, the header of what is filtered");
    if (options.json) throw UsageError("a filtered file is CSV: --json prints the numbers of a filter");
    try {
      return filter_file(options);
    } catch (const identification::IdentificationError& error) {
      throw UsageError(error.what());
    }
  }
  if (!options.column.empty() || !options.out_file.empty())
    throw UsageError("--column and --out belong to a file");
  if (options.rate_hz == 0.0) throw UsageError("--rate-hz is needed without a file");
  if (!(options.cutoff_hz < 0.5 * options.rate_hz)) {
    throw UsageError(fmt::format("--cutoff-hz is {:g} but must be below half of --rate-hz, {:g} Hz",
                                 options.cutoff_hz, 0.5 * options.rate_hz));
  }
  const Numbers numbers = numbers_of(options);
  options.json ? print_json(options, numbers) : print_numbers(options, numbers);
  return kExitOk;
}

}  // namespace drivebench::command
