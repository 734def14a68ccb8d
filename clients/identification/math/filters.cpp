#include "clients/identification/math/filters.hpp"

#include <algorithm>
#include <numbers>
#include <numeric>
#include <string>
#include <utility>

#include "plant/math/phasor.hpp"

namespace drivebench::identification {
namespace {

constexpr double kPi = std::numbers::pi;

std::vector<double> product(const std::vector<double>& x, const std::vector<double>& y) {
  std::vector<double> z(x.size() + y.size() - 1, 0.0);
  for (std::size_t i = 0; i < x.size(); ++i) {
    for (std::size_t j = 0; j < y.size(); ++j)
      z[i + j] += x[i] * y[j];
  }
  return z;
}

/// sum c_i s^(n-i) under s = rate (1 - q)/(1 + q), times (1 + q)^n; ascending powers of q = z^-1.
std::vector<double> mapped(const std::vector<double>& c, std::size_t order, double rate) {
  std::vector<double> sum(order + 1, 0.0);
  const std::size_t lacking = order + 1 - c.size();
  for (std::size_t i = 0; i < c.size(); ++i) {
    const std::size_t power = order - lacking - i;
    std::vector<double> term = {c[i]};
    for (std::size_t k = 0; k < order; ++k)
      term = product(term, k < power ? std::vector<double>{rate, -rate} : std::vector<double>{1.0, 1.0});
    for (std::size_t k = 0; k <= order; ++k)
      sum[k] += term[k];
  }
  return sum;
}

void check_order(int order) {
  if (order < 1 || order > 64)
    throw IdentificationError("the order of a low-pass is 1 to 64, not " + std::to_string(order));
}

}  // namespace

std::vector<std::complex<double>> butterworth_poles(int order) {
  check_order(order);
  std::vector<std::complex<double>> poles;
  for (int k = 1; k <= order; ++k)
    poles.push_back(phasor(kPi * (2.0 * k + order - 1.0) / (2.0 * order)));
  return poles;
}

std::vector<AnalogFilter> butterworth_sections(int order, double cutoff_rad_s) {
  std::vector<AnalogFilter> sections;
  const auto poles = butterworth_poles(order);
  for (int k = 0; k < order / 2; ++k) {
    const double damping = -2.0 * poles[static_cast<std::size_t>(k)].real() * cutoff_rad_s;
    const double square = cutoff_rad_s * cutoff_rad_s;
    sections.push_back({.numerator = {square}, .denominator = {1.0, damping, square}});
  }
  if (order % 2 != 0) sections.push_back({.numerator = {cutoff_rad_s}, .denominator = {1.0, cutoff_rad_s}});
  return sections;
}

DigitalFilter bilinear(const AnalogFilter& filter, double period_s, double exact_rad_s) {
  const CosSin half_turn = cos_sin(0.5 * exact_rad_s * period_s);
  const double rate = exact_rad_s > 0.0 ? exact_rad_s * half_turn.cos / half_turn.sin : 2.0 / period_s;
  const std::size_t order = filter.denominator.size() - 1;
  DigitalFilter digital = {.b = mapped(filter.numerator, order, rate),
                           .a = mapped(filter.denominator, order, rate)};
  const double first = digital.a[0];
  for (double& x : digital.b)
    x /= first;
  for (double& x : digital.a)
    x /= first;
  return digital;
}

StateSpaceFilter::StateSpaceFilter(const DigitalFilter& filter)
    : feedback_(filter.a.rbegin(), filter.a.rend() - 1),
      through_(filter.b[0]),
      gain_(1.0 / std::accumulate(filter.a.begin(), filter.a.end(), 0.0)),
      state_(feedback_.size(), 0.0) {
  for (std::size_t i = filter.b.size(); i-- > 1;)
    output_.push_back(filter.b[i] - filter.b[0] * filter.a[i]);
}

void StateSpaceFilter::settle(double u) {
  std::fill(state_.begin(), state_.end(), gain_ * u);
}

double StateSpaceFilter::step(double u) {
  const double y = std::inner_product(state_.begin(), state_.end(), output_.begin(), through_ * u);
  const double last = u - std::inner_product(state_.begin(), state_.end(), feedback_.begin(), 0.0);
  std::shift_left(state_.begin(), state_.end(), 1);
  state_.back() = last;
  return y;
}

namespace {

/// One pass of all sections over the samples, in the order of the iterators.
template <class Iterator>
void pass(Iterator begin, Iterator end, const std::vector<DigitalFilter>& sections) {
  for (const DigitalFilter& section : sections) {
    StateSpaceFilter filter(section);
    filter.settle(*begin);
    for (Iterator at = begin; at != end; ++at)
      *at = filter.step(*at);
  }
}

}  // namespace

Series zero_phase(SeriesView x, const LowPass& filter, double period_s) {
  if (filter.cutoff_hz == 0.0 || x.size() < 2) return {x.begin(), x.end()};
  if (!(filter.cutoff_hz > 0.0 && filter.cutoff_hz * period_s < 0.5))
    throw IdentificationError("the corner of a low-pass must lie between 0 and half the sampling rate, " +
                              std::to_string(0.5 / period_s) + " Hz; it is " +
                              std::to_string(filter.cutoff_hz) + " Hz");
  const double cutoff_rad_s = 2.0 * kPi * filter.cutoff_hz;
  std::vector<DigitalFilter> sections;
  for (const AnalogFilter& section : butterworth_sections(filter.order, cutoff_rad_s))
    sections.push_back(bilinear(section, period_s, cutoff_rad_s));
  // After two periods of the corner frequency the transient of the start has decayed below 1e-3.
  const auto wanted = static_cast<std::size_t>(2.0 / (filter.cutoff_hz * period_s)) +
                      3 * static_cast<std::size_t>(filter.order);
  const std::size_t edge = std::min(wanted, x.size() - 1);
  Series y;
  y.reserve(x.size() + 2 * edge);
  for (std::size_t k = edge; k > 0; --k)
    y.push_back(2.0 * x.front() - x[k]);
  y.insert(y.end(), x.begin(), x.end());
  for (std::size_t k = 1; k <= edge; ++k)
    y.push_back(2.0 * x.back() - x[x.size() - 1 - k]);
  pass(y.begin(), y.end(), sections);
  pass(y.rbegin(), y.rend(), sections);
  const auto offset = static_cast<std::ptrdiff_t>(edge);
  return {y.begin() + offset, y.end() - offset};
}

}  // namespace drivebench::identification
