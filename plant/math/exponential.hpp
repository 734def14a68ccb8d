#pragma once

namespace drivebench {

/// e^x with the same bits on every machine: see plant/trig.hpp. Error below 1 ulp where the result is a
/// normal number, measured by tests/plant/exponential_test.cpp. Too large gives infinity, too small zero, NaN
/// itself.
double exponential(double x) noexcept;

}  // namespace drivebench
