#pragma once

#include <complex>
#include <span>
#include <vector>

namespace drivebench::control {

/// All roots of c[0] + c[1]·x + ... + c[n]·xⁿ, multiple ones as often as they occur, by the iteration of
/// Weierstrass (Durand-Kerner) on the polynomial scaled to roots of about one. Good to about 1e-12 relative
/// for roots that stand apart, 1e-6 for double ones. For offline use: degrees of a control loop, not of a
/// filter bank.
std::vector<std::complex<double>> roots(std::span<const double> coefficients);

/// The real ones of them, in rising order: imaginary part below 1e-6 of the magnitude.
std::vector<double> real_roots(std::span<const double> coefficients);

}  // namespace drivebench::control
