#pragma once

#include "clients/identification/data/result.hpp"

namespace drivebench::identification {

/// A motor with a magnetising curve near a straight one, whose curve is still a line up to this flux: five
/// points at the places of Chebyshev, where a polynomial does not swing between them; or the curve of `near`.
Result saturated_start(const Result& straight, double largest_wb, const Result* near = nullptr);

/// Whether the leakages of these values are above zero.
bool is_motor(const Result& result);

/// Why a curve is none of iron; empty if it may be one: more flux needs more current, and no less of it per
/// flux than without flux. Five points bend around a wrong instant of the voltages as well, but leave more of
/// them unexplained than `white_v`, their measured noise.
std::string reason_against_curve(const Result& result, double white_v);

/// What a certified motor with a curve says beside its numbers.
std::string curve_note(const Result& result);

}  // namespace drivebench::identification
