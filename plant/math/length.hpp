#pragma once

#include <cmath>

namespace drivebench {

/// Length of the vector (x, y), sqrt(x² + y²): error below 1.2 ulp. The squares of what a drive has fit into
/// a double; beyond 1e154 they are infinite, and below 1e-146 digits are lost. The C library's hypot avoids
/// that, at twice the time, and its last bit depends on the version of the library.
inline double length(double x, double y) noexcept {
  return std::sqrt(x * x + y * y);
}

}  // namespace drivebench
