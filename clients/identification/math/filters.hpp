#pragma once

#include <complex>
#include <vector>

#include "clients/identification/math/series.hpp"

namespace drivebench::identification {

/// A rational transfer function in s, highest power first.
struct AnalogFilter {
  std::vector<double> numerator;
  std::vector<double> denominator;
};

/// A rational transfer function in z^-1: y_k = b_0 u_k + b_1 u_(k-1) + ... - a_1 y_(k-1) - ..., a_0 = 1.
struct DigitalFilter {
  std::vector<double> b;
  std::vector<double> a;
};

/// Poles of the Butterworth low-pass of corner 1 rad/s, e^(j pi (2k + n - 1)/(2n)), k = 1 .. n.
/// Source: the book, 2.8; tag FLT-01.
std::vector<std::complex<double>> butterworth_poles(int order);

/// The Butterworth low-pass, |G|^2 = 1/(1 + (w/w_c)^(2n)), as a product of second-order sections (and one of
/// first order): at a high order and a corner far below the sampling rate double precision cannot hold the
/// coefficients of one polynomial.
std::vector<AnalogFilter> butterworth_sections(int order, double cutoff_rad_s);

/// The trapezoidal rule, s = (2/T)(1 - z^-1)/(1 + z^-1). With `exact_rad_s` the factor 2/T becomes
/// w/tan(w T/2), so that the response at that frequency is the analog one. Tag FLT-02.
DigitalFilter bilinear(const AnalogFilter& filter, double period_s, double exact_rad_s = 0.0);

/// The filter in controllable canonical form: x_n(k+1) = u - a_n x_1 - ... - a_1 x_n, the other states shift,
/// y = sum (b_i - b_0 a_i) x_(n+1-i) + b_0 u. Source: (2.54); tag FLT-03.
class StateSpaceFilter {
 public:
  explicit StateSpaceFilter(const DigitalFilter& filter);
  /// Sets the steady state of a constant input.
  void settle(double u);
  double step(double u);

 private:
  std::vector<double> feedback_;  ///< a_n .. a_1
  std::vector<double> output_;
  double through_;
  double gain_;  ///< of a constant input to each state
  std::vector<double> state_;
};

/// A Butterworth low-pass of the identification.
struct LowPass {
  int order = 3;
  double cutoff_hz = 0.0;  ///< 0: no filter
};

/// Filtered forward and backward: no phase, the gain is |G|^2, so half the amplitude at the corner. The ends
/// are continued by odd reflection (2 x_0 - x_k, at most the whole record) and both passes start settled, so
/// that a constant or a ramp passes unchanged. Throws IdentificationError if the corner is not below half the
/// sampling rate. Tag FLT-04.
Series zero_phase(SeriesView x, const LowPass& filter, double period_s);

}  // namespace drivebench::identification
