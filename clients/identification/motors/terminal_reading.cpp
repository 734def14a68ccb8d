#include "clients/identification/motors/terminal_reading.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <initializer_list>
#include <numbers>
#include <vector>

#include "clients/identification/data/noise.hpp"
#include "clients/identification/data/signals.hpp"
#include "plant/math/length.hpp"
#include "plant/math/phasor.hpp"

namespace drivebench::identification {
namespace {

using Phasor = std::complex<double>;

constexpr std::size_t kDcParts = 20;
constexpr std::size_t kLeastPeriods = 5;
/// The least change of the admittance over the window that counts as one.
constexpr double kLeastTrend = 5e-3;

/// Slope of the straight line through equidistant values, and its standard deviation, per step.
template <class Value>
struct Line {
  Value slope{};
  double deviation = 0.0;
  double scatter = 0.0;  ///< rms of the values about the line
};

template <class Value>
Line<Value> line_through(const std::vector<Value>& values) {
  const auto n = static_cast<double>(values.size());
  Value mean{};
  for (const Value& value : values)
    mean += value / n;
  Value moment{};
  double squares = 0.0;
  for (std::size_t k = 0; k < values.size(); ++k) {
    const double place = static_cast<double>(k) - 0.5 * (n - 1.0);
    moment += place * (values[k] - mean);
    squares += place * place;
  }
  Line<Value> line{.slope = moment / squares};
  for (std::size_t k = 0; k < values.size(); ++k) {
    const double place = static_cast<double>(k) - 0.5 * (n - 1.0);
    line.scatter += std::norm(values[k] - mean - place * line.slope);
  }
  line.scatter = std::sqrt(line.scatter / std::max(1.0, n - 2.0));
  line.deviation = line.scatter / std::sqrt(squares);
  return line;
}

/// The t quantile of 97.5 %, by the expansion of Cornish and Fisher: 2.73 for 4 degrees of freedom (2.78).
double student(double freedom) {
  return 1.95996 + 2.3723 / freedom + 2.8225 / (freedom * freedom);
}

std::vector<Phasor> vectors(const TwoPhaseSeries& x, const SampleRange& range, bool backwards) {
  std::vector<Phasor> z;
  z.reserve(range.count());
  for (std::size_t k = range.first; k < range.end; ++k)
    z.emplace_back(x.a[k], backwards ? -x.b[k] : x.b[k]);
  return z;
}

/// The frequency at which the voltages turn, negative against the order of the phases.
double turning_hz(const std::vector<Phasor>& u, double period_s) {
  std::vector<double> angle;
  angle.reserve(u.size());
  double sum = 0.0;
  for (std::size_t k = 0; k < u.size(); ++k) {
    if (k > 0) sum += argument(u[k] * std::conj(u[k - 1]));
    angle.push_back(sum);
  }
  const Line<double> line = line_through(angle);
  constexpr double kMostScatter_rad = 0.5;
  if (!(line.scatter < kMostScatter_rad))
    throw IdentificationError(fmt::format(
        "the voltages do not turn evenly (their angle strays by {:.2g} rad): a test with AC needs "
        "the voltages of a line or a filtered inverter",
        line.scatter));
  return line.slope / (2.0 * std::numbers::pi * period_s);
}

/// The means of a record over its parts, turned back by the frequency.
struct Parts {
  std::vector<Phasor> voltage;
  std::vector<Phasor> current;
  Phasor whole_voltage;
  Phasor whole_current;
  Phasor opposite_voltage;  ///< what turns the other way
};

Parts parts_of(const std::vector<Phasor>& u, const std::vector<Phasor>& i, std::size_t count, double length,
               double angle_step) {
  Parts parts;
  std::size_t total = 0;
  for (std::size_t part = 0; part < count; ++part) {
    const auto begin = static_cast<std::size_t>(std::lround(static_cast<double>(part) * length));
    const auto end =
        std::min(u.size(), static_cast<std::size_t>(std::lround(static_cast<double>(part + 1) * length)));
    Phasor voltage;
    Phasor current;
    for (std::size_t k = begin; k < end; ++k) {
      const Phasor back = phasor(-angle_step * static_cast<double>(k));
      voltage += u[k] * back;
      current += i[k] * back;
      parts.opposite_voltage += u[k] * std::conj(back);
    }
    parts.whole_voltage += voltage;
    parts.whole_current += current;
    total += end - begin;
    parts.voltage.push_back(voltage / static_cast<double>(end - begin));
    parts.current.push_back(current / static_cast<double>(end - begin));
  }
  parts.whole_voltage /= static_cast<double>(total);
  parts.whole_current /= static_cast<double>(total);
  parts.opposite_voltage /= static_cast<double>(total);
  return parts;
}

/// The rms of a converter's rounding if the signal's noise does not round it off; else 0. From the whole
/// record: a steady direct current may show no step.
double bare_rounding(const MeasuredData& data, std::initializer_list<const char*> names) {
  double worst = 0.0;
  for (const char* name : names) {
    const Column* const column = data.find(name);
    if (column != nullptr) worst = std::max(worst, rounding_without_noise(column->values));
  }
  return worst;
}

/// The relative uncertainty of a quotient that rounding leaves if each of `repeats` samples always errs
/// alike.
double rounding_part(const MeasuredData& data, const Parts& parts, double repeats) {
  const double u = bare_rounding(data, {"u_a_v", "u_b_v", "u_c_v"}) / magnitude(parts.whole_voltage);
  const double i = bare_rounding(data, {"i_a_a", "i_b_a", "i_c_a"}) / magnitude(parts.whole_current);
  return length(u, i) / std::sqrt(repeats);
}

void check_current(const Parts& parts) {
  if (!(magnitude(parts.whole_voltage) > 0.0)) throw IdentificationError("the record has no voltage");
  if (!(magnitude(parts.whole_current) > 0.0)) throw IdentificationError("the record has no current");
}

/// Throws if the admittance moves through the window by more than its scatter.
void check_steady(const std::vector<Phasor>& admittance, const SampleRange& range, double period_s) {
  const Line<Phasor> line = line_through(admittance);
  const auto count = static_cast<double>(admittance.size());
  const double change = count * magnitude(line.slope) / magnitude(admittance.back());
  if (!(change > kLeastTrend) || magnitude(line.slope) < 4.0 * line.deviation) return;
  throw IdentificationError(fmt::format(
      "the current over the voltage changes by {:.2g} % between {:.4g} and {:.4g} s: the test reads a steady "
      "state; record longer, or choose a later part with --window",
      100.0 * change, static_cast<double>(range.first) * period_s,
      static_cast<double>(range.end) * period_s));
}

std::optional<double> speed_of(const MeasuredData& data, const Settings& e, const SampleRange& range) {
  if (data.find(e.counts_per_revolution > 0.0 ? "encoder_count" : "angle_rad") == nullptr)
    return std::nullopt;
  const Series angle = measured_angle(data, e);
  const auto first = angle.begin() + static_cast<std::ptrdiff_t>(range.first);
  const std::vector<double> window(first, first + static_cast<std::ptrdiff_t>(range.count()));
  return magnitude(line_through(window).slope) / data.period_s;
}

/// Meter and intervals from the means of the parts.
void fill(TerminalReading& reading, const Parts& parts, double rounding, Phasor voltage_shift) {
  std::vector<Phasor> impedance;
  impedance.reserve(parts.voltage.size());
  for (std::size_t k = 0; k < parts.voltage.size(); ++k)
    impedance.push_back(parts.voltage[k] / parts.current[k] * voltage_shift);
  const Phasor u = parts.whole_voltage * voltage_shift;
  const Phasor i = parts.whole_current;
  const Phasor power = u * std::conj(i);
  const double root = std::sqrt(static_cast<double>(reading.phases));
  reading.meter.voltage_v = magnitude(u) / root;
  reading.meter.current_a = magnitude(i) / root;
  reading.meter.active_w = power.real();
  reading.meter.reactive_var = reading.meter.frequency_hz > 0.0 ? power.imag() : 0.0;
  const auto count = static_cast<double>(impedance.size());
  Phasor mean;
  for (const Phasor& z : impedance)
    mean += z / count;
  double real = 0.0;
  double imaginary = 0.0;
  for (const Phasor& z : impedance) {
    real += (z.real() - mean.real()) * (z.real() - mean.real());
    imaginary += (z.imag() - mean.imag()) * (z.imag() - mean.imag());
  }
  const double per_part = student(count - 1.0) / std::sqrt(count * (count - 1.0));
  const double steps = 1.96 * rounding * (magnitude(u) / magnitude(i));
  reading.real_interval_ohm = length(per_part * std::sqrt(real), steps);
  reading.imaginary_interval_ohm = length(per_part * std::sqrt(imaginary), steps);
  reading.parts = impedance.size();
}

}  // namespace

TerminalReading read_terminals(const MeasuredData& data, const Settings& settings, Feed feed) {
  Processing window = settings.processing;
  const double length_s = data.period_s * static_cast<double>(data.samples());
  if (window.from_s == 0.0 && window.to_s == 0.0) window.from_s = length_s * 2.0 / 3.0;
  const SampleRange range = window_of(data, window);
  const TwoPhaseSeries u_windings = windings(data, settings, 'u', 'v');
  const TwoPhaseSeries i_windings = windings(data, settings, 'i', 'a');

  TerminalReading reading{.phases = settings.three_phase ? 3 : 2};
  std::vector<Phasor> u = vectors(u_windings, range, false);
  std::size_t count = kDcParts;
  double length = static_cast<double>(range.count()) / static_cast<double>(kDcParts);
  double turning = 0.0;
  if (feed == Feed::kAc) {
    turning = turning_hz(u, data.period_s);
    reading.meter.frequency_hz = std::abs(turning);
    const double periods = static_cast<double>(range.count()) * std::abs(turning) * data.period_s;
    count = static_cast<std::size_t>(periods + 1e-6);
    if (count < kLeastPeriods)
      throw IdentificationError(fmt::format(
          "the window from {:.4g} to {:.4g} s holds {} periods of the voltage ({:.4g} Hz); a test "
          "with AC needs {} at least",
          static_cast<double>(range.first) * data.period_s, static_cast<double>(range.end) * data.period_s,
          count, reading.meter.frequency_hz, kLeastPeriods));
    length = static_cast<double>(range.count()) / periods;
    u = vectors(u_windings, range, turning < 0.0);
  }
  const double angle_step = 2.0 * std::numbers::pi * reading.meter.frequency_hz * data.period_s;
  const std::vector<Phasor> i = vectors(i_windings, range, turning < 0.0);
  const Parts parts = parts_of(u, i, count, length, angle_step);
  check_current(parts);
  std::vector<Phasor> admittance;
  admittance.reserve(count);
  for (std::size_t k = 0; k < count; ++k)
    admittance.push_back(parts.current[k] / parts.voltage[k]);
  check_steady(admittance, range, data.period_s);

  // A period repeats the errors of its samples, and neighbours err alike where the signal moves by nearly
  // whole steps: sines of 100 to 400 steps have three times the error of as many independent samples at most.
  constexpr double kErrAlike = 6.0;
  const double repeats = feed == Feed::kAc ? length / kErrAlike : 1.0;
  fill(reading, parts, rounding_part(data, parts, repeats),
       phasor(angle_step * settings.processing.voltage_shift));
  if (feed == Feed::kAc)
    reading.unbalance = magnitude(parts.opposite_voltage) / magnitude(parts.whole_voltage);
  reading.speed_rad_s = speed_of(data, settings, range);
  // Errors of half a step move the line through N of them by 1.5/N steps a sample at most. At an even speed
  // they do not average out: they may repeat with every sample.
  if (reading.speed_rad_s && settings.counts_per_revolution > 0.0)
    reading.speed_bound_rad_s = 3.0 * std::numbers::pi / settings.counts_per_revolution /
                                (static_cast<double>(range.count()) * data.period_s);
  reading.from_s = static_cast<double>(range.first) * data.period_s;
  reading.to_s = static_cast<double>(range.end) * data.period_s;
  return reading;
}

}  // namespace drivebench::identification
