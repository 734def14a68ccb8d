#pragma once

#include <cstdint>

#include "plant/injected_faults.hpp"

namespace drivebench {

/// Section [axis.hall]: three lines, each high for 180 electrical degrees, 120 degrees apart.
struct HallParameters {
  bool enabled = false;
  double offset_rad = 0.0;  ///< electrical angle by which they are displaced
};

/// Lines 1, 2, 3 as bits 0, 1, 2 at an electrical angle n_p theta. Line k is high while that angle, less the
/// offset and less (k-1) 120 degrees, lies in [-30, 150) degrees. So without an offset the lines change where
/// a trapezoidal machine commutates (the book, (10.10)), and while it turns forward they say
///   angle    -30..30   30..90   90..150   150..210   210..270   270..330 degrees
///   lines         5        1         3          2          6          4
/// 0 and 7 come with a stuck line only. A sensor that is not enabled says 0.
std::uint32_t hall_lines(const HallParameters& p, const InjectedFaults& faults,
                         double electrical_rad) noexcept;

/// The same in a sector of 60 electrical degrees: sector 0 is -30..30 degrees, and they go on with the turns.
std::uint32_t hall_lines_in(std::int64_t sector, const InjectedFaults& faults) noexcept;

}  // namespace drivebench
