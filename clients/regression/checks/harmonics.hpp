#pragma once

#include <optional>
#include <span>
#include <vector>

namespace drivebench::regression {

/// The amplitudes of mean (0), fundamental (1) and harmonics up to the last, by least squares:
///
///   x_k ≈ m + Σ a_n · cos(2π·n·f·k) + b_n · sin(2π·n·f·k),  n = 1 … N,  amplitude of n = √(a_n² + b_n²)
///
/// So the window need not hold whole periods. `f` is in periods a sample; a period must have at least 2·N + 1
/// samples, and the window more than one period.
std::vector<double> harmonic_amplitudes(std::span<const double> values, double periods_a_sample,
                                        int harmonics);

/// The fundamental of a periodic signal [periods a sample]: from its rises through the mean, by more than its
/// rms, and from there to the maximum of its spectrum under a Hann window. Nothing if it does not rise twice.
std::optional<double> fundamental_of(std::span<const double> values);

}  // namespace drivebench::regression
