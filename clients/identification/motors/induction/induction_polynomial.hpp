#pragma once

#include "clients/identification/math/real_roots.hpp"

namespace drivebench::identification {

/// The polynomial P of search_induction(): its positive roots are the stationary points of E^2 over K_8.
WholePolynomial induction_polynomial(const Triangle& factor);

}  // namespace drivebench::identification
