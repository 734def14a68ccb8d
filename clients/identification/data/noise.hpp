#pragma once

#include "clients/identification/math/series.hpp"

namespace drivebench::identification {

/// The rms of the white part of a signal, without a model: from the median of its fourth differences, which a
/// smooth signal hardly has and a few edges do not move, and not below the step of its quantisation/sqrt(12).
/// A signal with edges at every sample shows more than its noise: an upper bound.
double white_noise(SeriesView x);

/// The rms of a converter's rounding, step/sqrt(12), where the noise of the signal is too small to round it
/// off: below a step, so that a steady signal errs by the same each time. 0 elsewhere.
double rounding_without_noise(SeriesView x);

}  // namespace drivebench::identification
